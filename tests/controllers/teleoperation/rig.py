"""A teleoperation stepped by hand: a master, a clutch and a clock."""

import numpy as np

from controllers.teleoperation.controller import Teleoperation
from controllers.teleoperation.params import TeleoperationParams
from hub.testing import Driver
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
        self.driver = Driver(self.teleoperation, period_ns=H)
        self.values = self.driver.values
        self.driver.set("master", [0.3, -0.1, 0.2, 0.0, 0.0, 0.0, 1.0])
        self.states, self.warnings = [], []

    outputs = property(lambda self: self.driver.outputs)
    hand = property(lambda self: self.values["master"])
    twist = property(lambda self: self.values["master_twist"])
    measured = property(lambda self: self.values["measured_js"])
    scale = property(lambda self: self.values["scale"])

    def step(self, *clutch, stale=False, count=1, arm=None):
        """Step; `clutch`: lists of buttons, each an event of the first step; `arm`: an operating state and
        whether it is homed.
        """
        self.driver.stale(*(["master"] if stale else []))
        self.driver.send("buttons", *(Joy(buttons=buttons) for buttons in clutch))
        if arm is not None:
            self.driver.send("operating_state", OperatingState(state=arm[0], is_homed=arm[1]))
        self.driver.step(count)
        self.states += [message.data for message in self.driver.sent.get("state", ())]
        self.warnings += [message.data for message in self.driver.sent.get("warning", ())]
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
