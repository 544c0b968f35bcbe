"""A controller: torque = stiffness (goal - angle) - damping rate, within a limit."""

import numpy as np

from trocar import Inputs, Outputs, Params, Port, Setup, Stepped, state_hash


class PdControlParams(Params):
    """Of the controller, in a scenario."""

    stiffness: float = 2.0  # N m/rad
    damping: float = 0.1  # N m s/rad
    limit: float = 1.0  # N m


class PdControl(Stepped):
    """Holds the angle while the goal is stale: its device has stopped sending."""

    params_model = PdControlParams
    ports = (
        Port(name="goal", causality="input", type="std_msgs/msg/Float64", unit="rad", max_age_ns=100_000_000),
        Port(name="angle", causality="input", unit="rad"),
        Port(name="rate", causality="input", unit="rad/s"),
        Port(name="torque", causality="output", unit="N*m"),
    )

    def configure(self, setup: Setup) -> Outputs:
        self.state = np.zeros(2)  # goal (rad), torque (N m)
        return {"torque": self.state[1:].copy()}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        p, goal, angle = self.params, self.state[0], inputs["angle"][0]
        if not inputs.stale("goal"):
            goal = inputs["goal"][0]
        torque = p.stiffness * (goal - angle) - p.damping * inputs["rate"][0]
        self.state[:] = goal, np.clip(torque, -p.limit, p.limit)
        return {"torque": self.state[1:].copy()}

    def state_hash(self) -> int:
        return state_hash(self.state)

    def close(self) -> None:
        """Nothing is held."""
