"""A teleoperation stepped by hand: a master, a clutch and a clock."""

from pathlib import Path

import numpy as np

from controllers.teleoperation.controller import Teleoperation
from controllers.teleoperation.params import TeleoperationParams
from hub.participant import Inputs, Setup
from robots import rotation
from schemas.crtk import OperatingState
from schemas.ros import Joy

H = 1_000_000


class Session:
    """Inputs are vectors to write to; outputs are those of the last step; what was said since the start is
    kept.
    """

    def __init__(self, **params):
        self.teleoperation = Teleoperation("teleop", TeleoperationParams.model_validate(params))
        self.params, self.chain = self.teleoperation.params, self.teleoperation.params.chain
        self.outputs = self.teleoperation.configure(Setup(period_ns=H, directory=Path()))
        values = {
            port.name: np.array(port.start or ())
            for port in self.teleoperation.ports
            if port.causality == "input"
        }
        self.values = values | {
            "master": np.array([0.3, -0.1, 0.2, 0.0, 0.0, 0.0, 1.0]),
            "master_twist": np.zeros(6),
        }
        self.values["base_in_view"] = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
        self.inputs = Inputs(self.values)
        self.states, self.warnings, self.t = [], [], 0

    hand = property(lambda self: self.values["master"])
    twist = property(lambda self: self.values["master_twist"])
    measured = property(lambda self: self.values["measured_js"])
    scale = property(lambda self: self.values["scale"])

    def step(self, *clutch, stale=False, count=1, arm=None):
        """Step; `clutch`: lists of buttons, each an event of the first step; `arm`: an operating state and
        whether it is homed.
        """
        self.inputs._stale = {"master"} if stale else set()
        self.inputs._events = {"buttons": tuple(Joy(buttons=buttons) for buttons in clutch)}
        if arm is not None:
            self.inputs._events["operating_state"] = (OperatingState(state=arm[0], is_homed=arm[1]),)
        for _ in range(count):
            self.outputs = self.teleoperation.step(self.t, H, self.inputs)
            self.t += H
            self.states += [message.data for message in self.outputs["state"]]
            self.warnings += [message.data for message in self.outputs["warning"]]
            self.inputs._events = {}
        return self.tip

    def turn_hand(self, vector):
        """Turn the hand by a rotation vector of its base frame."""
        turned = rotation.product(rotation.exp(np.array(vector)), self.hand[3:])
        self.hand[3:] = turned / np.linalg.norm(turned)

    @property
    def command(self):
        return self.outputs["servo_jp"].copy()

    @property
    def tip(self):
        """Position of the tip at the command."""
        return self.chain.forward(self.outputs["servo_jp"])[:3, 3].copy()

    @property
    def turn(self):
        return self.chain.forward(self.outputs["servo_jp"])[:3, :3]

    @property
    def follows(self):
        return self.outputs["following"].data
