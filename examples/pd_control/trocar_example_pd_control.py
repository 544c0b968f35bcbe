"""A controller: torque = stiffness (goal - angle) - damping rate, within a limit."""

import numpy as np

from trocar import Controller, Inputs, Outputs, Params, Setup, signal_in, signal_out
from trocar.records import Record, array, number


class PdControlParams(Params):
    """Of the controller, in a scenario."""

    stiffness: float = 2.0  # N m/rad
    damping: float = 0.1  # N m s/rad
    limit: float = 1.0  # N m


class PdState(Record):
    """All that the controller remembers: it is hashed, saved and restored by the base class."""

    goal = number()  # rad
    torque = array(1)  # N m


class PdControl(Controller):
    """Holds the angle while the goal is stale: its device has stopped sending."""

    params_model = PdControlParams
    ports = (
        signal_in("goal", "std_msgs/msg/Float64", unit="rad", max_age_ns=100_000_000),
        signal_in("angle", unit="rad"),
        signal_in("rate", unit="rad/s"),
        signal_out("torque", unit="N*m"),
    )

    def __init__(self, name: str, params: PdControlParams) -> None:
        super().__init__(name, params)
        self.state = PdState()
        self.keep(self.state)

    def configure(self, setup: Setup) -> Outputs:
        return {"torque": self.state.torque}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        p, state = self.params, self.state
        if not inputs.stale("goal"):
            state.goal = inputs["goal"][0]
        torque = p.stiffness * (state.goal - inputs["angle"][0]) - p.damping * inputs["rate"][0]
        state.torque[0] = np.clip(torque, -p.limit, p.limit)
        return {"torque": state.torque}
