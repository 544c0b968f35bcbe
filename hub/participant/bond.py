"""The two sides of a power bond inside an engine's step: prediction, virtual coupling forces and work.

The force side makes its sub-steps on the predicted motion of the motion side and sums impulse and work; the
motion side applies the received wrench and sums its work. Frames (dof 6) use the convention pose (x, y, z,
qx, qy, qz, qw), twist (linear, angular), wrench (force, torque), all expressed in the bond's frame. In
shapes, `size` and `linear` are fields of the `BondSide`. Scheme and rules: docs/decisions/0004-coupling.md.
"""

from __future__ import annotations

import numpy as np

from hub.participant.inputs import Inputs
from hub.participant.stepped import BondPlan
from schemas.ports import BondSide, bond_ports
from schemas.vectors import Vector

__all__ = ["ForceSide", "MotionSide"]


class ForceSide:
    """The force side of a bond: the predicted motion of the motion side in a step, impulse and work.

    Examples:
        side = ForceSide(self.bonds[0], setup.bonds["tip"])    # in configure
        side.begin(inputs, h / 1e9)                            # then in each step, with sub-steps of dt:
        spring = k * (side.position(tau) - x)                  # N, at tau seconds into the step
        damper = b * (side.velocity(tau) - v)
        side.add(spring, damper, tau, dt)
        return side.result(spring, damper)                     # outputs: reaction and work
    """

    def __init__(self, bond: BondSide, plan: BondPlan) -> None:
        self._position, self._velocity, self.force_port = (port.name for port in bond_ports(bond))
        self._plan = plan
        self._is_sloped = plan.prediction == "slope"
        self._size = bond.size
        self._linear = bond.linear
        self.work_port = f"{bond.name}/work"
        self._work = np.zeros(1)
        self._x = np.zeros(self._linear)
        self._v = self._v_before = np.zeros(self._size)
        self._a = np.zeros(self._size)
        self._spring = np.zeros(self._linear)
        self._stiffness = bond.stiffness or 0.0
        self._duration = 0.0
        self._started = False

    def set_stiffness(self, stiffness: float) -> None:
        """Count the work of jumps with another stiffness (N/m) of the virtual coupling from now on."""
        self._stiffness = stiffness

    def begin(self, inputs: Inputs, h: float) -> None:
        """Read the motion at the start of a step of `h` seconds.

        Where the motion differs by d from the prediction, the spring is displaced by d at once and receives
        the work F d + k d^2 / 2, with the spring force F at the end of the last step.
        """
        x, v = inputs[self._position][: self._linear], inputs[self._velocity]
        if self._started:
            jump = x - self.position(self._duration)
            self._work[0] += float(self._spring.dot(jump) + 0.5 * self._stiffness * jump.dot(jump))
            if self._is_sloped:
                self._a = (v - self._v_before) / h
        self._x, self._v, self._v_before = x.copy(), v.copy(), v.copy()
        self._duration = h
        self._started = True
        self._impulse = np.zeros(self._size)
        self._summed = 0.0

    def position(self, tau: float) -> Vector:
        """Return the predicted position (m), shape (linear,), `tau` seconds into the step."""
        if self._plan.prediction == "hold":
            return self._x
        v = self._v[: self._linear]
        return self._x + tau * (v + 0.5 * tau * self._a[: self._linear] if self._is_sloped else v)

    def velocity(self, tau: float) -> Vector:
        """Return the predicted twist (m/s, rad/s), shape (size,), `tau` seconds into the step."""
        return self._v + tau * self._a if self._is_sloped else self._v

    def add(self, spring: Vector, damper: Vector, tau: float, dt: float) -> None:
        """Add the forces of a sub-step of `dt` seconds around `tau`.

        `spring`, `damper`: forces (N, N m; shape (size,)) pushing from the motion side.
        """
        force = spring + damper
        self._impulse += dt * force
        self._summed += dt
        moved = damper if self._plan.prediction == "hold" else force
        self._work[0] += dt * float(moved.dot(self.velocity(tau)))

    def result(self, spring: Vector, damper: Vector) -> dict[str, Vector]:
        """Return the outputs of the bond: the work, and the reaction on the motion side.

        The reaction is minus the mean force, or minus the force at the end. `spring`, `damper`: forces (N,
        N m; shape (size,)) at the end of the step, on the predicted motion.
        """
        self._spring = spring[: self._linear].copy()
        force = self._impulse / self._summed if self._plan.mean else spring + damper
        return {self.force_port: -force, self.work_port: self._work.copy()}

    @property
    def state(self) -> Vector:
        """The state of this side between steps, for hash, save and restore."""
        return np.concatenate(
            [
                self._work,
                self._x,
                self._v,
                self._v_before,
                self._a,
                self._spring,
                [self._duration, float(self._started)],
            ]
        )

    @state.setter
    def state(self, state: Vector) -> None:
        sizes = np.cumsum([1, self._linear, self._size, self._size, self._size, self._linear, 1])
        self._work, self._x, self._v, self._v_before, self._a, self._spring, duration, started = np.split(
            state.copy(), sizes
        )
        self._duration, self._started = float(duration[0]), bool(started[0])


class MotionSide:
    """The motion side of a bond: the force to apply in each sub-step, and the work done.

    Examples:
        side = MotionSide(self.bonds[0], setup.bonds["tip"])   # in configure
        side.begin(inputs, x, v)                               # then in each step, with sub-steps:
        force = side.force(tau, x, v)                          # N, at tau seconds into the step
        side.add(force, moved)                                 # m, in the sub-step
        return side.result(x, v)                               # outputs: position, velocity, work
    """

    def __init__(self, bond: BondSide, plan: BondPlan) -> None:
        self.position_port, self.velocity_port, self.force_port = (port.name for port in bond_ports(bond))
        self._correction = plan.correction
        self._linear = bond.linear
        self.work_port = f"{bond.name}/work"
        self._work = np.zeros(1)

    @property
    def is_even(self) -> bool:
        """Whether the force is the same all through a step."""
        return self._correction is None

    def begin(self, inputs: Inputs, position: Vector, velocity: Vector) -> None:
        """Read the reaction for this step; `position` and `velocity` are the motion at the start."""
        self._reaction = inputs[self.force_port]
        if self._correction is not None:
            self._x, self._v = position[: self._linear].copy(), velocity[: self._linear].copy()

    def force(self, tau: float, position: Vector, velocity: Vector) -> Vector:
        """Return the force (N, N m; shape (size,)) on this side in the sub-step from `tau` seconds on.

        `position`, `velocity`: the motion of this side at the start of the sub-step.
        """
        if self._correction is None:
            return self._reaction
        c, force = self._correction, self._reaction.copy()
        behind = self._x + tau * self._v - position[: self._linear]
        force[: self._linear] += c.gain * (
            c.stiffness * behind + c.damping * (self._v - velocity[: self._linear])
        )
        return force

    def add(self, force: Vector, displacement: Vector) -> None:
        """Add the work against `force` over `displacement` (m, rad; shape (size,)) of a sub-step."""
        self._work[0] -= force.dot(displacement)

    def result(self, position: Vector, velocity: Vector) -> dict[str, Vector]:
        """Return the outputs of the bond at the end of the step; the array of the work is reused."""
        return {self.position_port: position, self.velocity_port: velocity, self.work_port: self._work}

    @property
    def state(self) -> Vector:
        """The state of this side between steps."""
        return self._work.copy()

    @state.setter
    def state(self, state: Vector) -> None:
        self._work[:] = state
