"""Two masses coupled by a spring-damper, each an engine of its own: the smallest co-simulation with a bond.

Mass 1 receives a force and returns position and velocity. Mass 2 carries the coupling spring: it receives
position and velocity and returns the force. Each is integrated in small sub-steps, so that any error comes
from the coupling.
"""

import numpy as np

from trocar import (
    BondSide,
    ForceSide,
    Inputs,
    MotionSide,
    Outputs,
    Params,
    Port,
    Setup,
    Stepped,
    state_hash,
)

SUB_STEPS = 50


class MassParams(Params):
    """One mass on a spring-damper to ground, in SI units.

    Of mass 2 also the coupling, and the position at which mass 1 starts.
    """

    mass: float
    stiffness: float
    damping: float
    x: float = 0.0
    coupling_stiffness: float = 0.0
    coupling_damping: float = 0.0
    coupled_x: float = 0.0


class Mass(Stepped):
    """Mass 1: moves under the force that it receives."""

    params_model = MassParams
    ports: tuple[Port, ...] = ()
    bonds = (BondSide(name="tip", side="motion", dof=1),)

    def configure(self, setup: Setup) -> Outputs:
        self.side = MotionSide(self.bonds[0], setup.bonds["tip"])
        self.x, self.v = np.array([self.params.x]), np.zeros(1)
        return self.side.result(self.x.copy(), self.v.copy())

    def move(self, force: np.ndarray, h: float) -> None:
        """Advance by the midpoint rule under a force that does not change within the sub-step."""
        p, x = self.params, self.x + 0.5 * h * self.v
        v = self.v + 0.5 * h * (force - p.stiffness * self.x - p.damping * self.v) / p.mass
        self.v = self.v + h * (force - p.stiffness * x - p.damping * v) / p.mass
        self.x = self.x + h * v

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        self.side.begin(inputs, self.x, self.v)
        dt = h / 1e9 / SUB_STEPS
        for i in range(SUB_STEPS):
            before, force = self.x, self.side.force((i + 0.5) * dt, self.x, self.v)
            self.move(force, dt)
            self.side.add(force, self.x - before)
        return self.side.result(self.x.copy(), self.v.copy())

    def state_hash(self) -> int:
        return state_hash(self.x, self.v, self.side.state)

    def close(self) -> None:
        """Nothing is held."""


class SprungMass(Mass):
    """Mass 2: carries the coupling spring-damper and returns its force."""

    @property
    def bonds(self) -> tuple[BondSide, ...]:
        p = self.params
        return (
            BondSide(
                name="tip",
                side="force",
                dof=1,
                stiffness=p.coupling_stiffness,
                damping=p.coupling_damping,
                proxy_mass=p.mass,
            ),
        )

    def configure(self, setup: Setup) -> Outputs:
        self.side = ForceSide(self.bonds[0], setup.bonds["tip"])
        self.x, self.v = np.array([self.params.x]), np.zeros(1)
        spring = self.params.coupling_stiffness * (self.params.coupled_x - self.x)
        return {self.side.force_port: -spring, self.side.work_port: np.zeros(1)}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        self.side.begin(inputs, h / 1e9)
        p, side, dt = self.params, self.side, h / 1e9 / SUB_STEPS
        for i in range(SUB_STEPS):
            tau = (i + 0.5) * dt
            spring = p.coupling_stiffness * (side.position(tau) - self.x - 0.5 * dt * self.v)
            damper = p.coupling_damping * (side.velocity(tau) - self.v)
            side.add(spring, damper, tau, dt)
            self.move(spring + damper, dt)
        end = h / 1e9
        return side.result(
            p.coupling_stiffness * (side.position(end) - self.x),
            p.coupling_damping * (side.velocity(end) - self.v),
        )
