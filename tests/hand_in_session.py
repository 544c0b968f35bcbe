"""A hand for sessions in a test: it stays where it is, and its buttons and gripper do as asked."""

import numpy as np

from hub.participant import Controller, Params, event_in, event_out, signal_in, signal_out
from schemas.ros import Float64Message, Joy, PoseStamped

__all__ = ["HandInSession"]

POSE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class HandInSession(Controller):
    """Passes on `asked`, the opening of the gripper, and `press`."""

    params_model = Params
    ports = (
        signal_in("asked", Float64Message, start=(1.0,)),
        event_in("press", Joy),
        signal_out("pose", PoseStamped, frame="hand_base"),
        signal_out("gripper", Float64Message),
        event_out("buttons", Joy),
    )

    def configure(self, setup):
        return {"pose": POSE, "gripper": np.ones(1), "buttons": ()}

    def step(self, t, h, inputs):
        return {"pose": POSE, "gripper": inputs["asked"], "buttons": inputs.events("press")}
