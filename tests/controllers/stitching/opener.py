"""A participant that opens a jaw in mid-stitch, again and again."""

import numpy as np

from controllers.stitching.phase import StitchPhase
from hub.participant import Controller, Params, event_out, signal_in
from schemas.ros import Float64Message, JointState

OPEN = JointState(name=("jaw",), position=np.array([0.7]))


class OpenerParams(Params):
    phase: str
    after: float
    """Time in the phase, s."""


class Opener(Controller):
    """Opens the jaw once each time that the phase has lasted for `after`."""

    params_model = OpenerParams

    def __init__(self, name, params):
        super().__init__(name, params)
        self._phase, self._began = StitchPhase[params.phase], None

    @property
    def ports(self):
        return (signal_in("phase", Float64Message, start=(0.0,)), event_out("jaw", JointState))

    def configure(self, setup):
        return {"jaw": ()}

    def step(self, t, h, inputs):
        if inputs["phase"][0] != self._phase:
            self._began = None
        elif self._began is None:
            self._began = t
        lasted = -1 if self._began is None else t - self._began
        return {"jaw": (OPEN,) if lasted == round(self.params.after * 1e9) else ()}
