"""An engine: a point mass on a rod, moved by a torque. theta'' = torque / (m l^2) - g / l sin(theta)."""

import numpy as np

from trocar import Inputs, Outputs, Params, Setup, Stepped, signal_in, signal_out, state_hash
from trocar.quantities import Angle, Length, Mass

GRAVITY = 9.80665  # m/s^2, standard gravity (CGPM 1901)


class PendulumParams(Params):
    """Of the pendulum, in a scenario."""

    mass: Mass = 0.1  # kg
    length: Length = 0.25  # m
    start: Angle = 0.0  # rad, 0 hangs down


class Pendulum(Stepped):
    """Hangs down at 0 rad; a positive torque raises the angle."""

    params_model = PendulumParams
    ports = (
        signal_in("torque", unit="N*m", start=(0.0,)),
        signal_out("angle", unit="rad"),
        signal_out("rate", unit="rad/s"),
    )

    def configure(self, setup: Setup) -> Outputs:
        self.state = np.array([self.params.start, 0.0])  # rad, rad/s
        return self._outputs()

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        p, dt, (angle, rate) = self.params, h * 1e-9, self.state
        torque = inputs["torque"][0]
        rate += dt * (torque / (p.mass * p.length**2) - GRAVITY / p.length * np.sin(angle))
        self.state[:] = angle + dt * rate, rate  # semi-implicit Euler
        return self._outputs()

    def _outputs(self) -> Outputs:
        return {"angle": self.state[:1].copy(), "rate": self.state[1:].copy()}

    def state_hash(self) -> int:
        return state_hash(self.state)

    def close(self) -> None:
        """Nothing is held."""
