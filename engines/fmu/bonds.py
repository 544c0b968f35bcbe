"""The two sides of a bond at a running FMU.

A communication step is a sub-step of the bond: the force side takes the predicted motion at both ends, and
the mean of the force at both ends; the motion side takes the force, and moves. An FMU that does not
interpolate has seen the middle of the motion: the bond's slopes bring its force to the end.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from engines.fmu.bond_variables import BondVariables, Quantity
from engines.fmu.instance import Instance
from engines.fmu.slopes import Derivatives, largest_stiffness
from hub.participant import BondPlan, ForceSide, Inputs, MotionSide
from schemas.vectors import Vector

__all__ = ["FmuForceSide", "FmuMotionSide", "FmuSide"]


class FmuSide(Protocol):
    """A side of a bond, in the order of calls."""

    def initial(self) -> dict[str, Vector]:
        """Return the bond's outputs at time 0."""
        ...

    def begin(self, inputs: Inputs, h: float) -> None:
        """Read the other side at the beginning of a step of `h` seconds."""
        ...

    def write(self, tau: float, dt: float) -> None:
        """Set the FMU's inputs for the `dt` seconds from `tau` seconds into the step on."""
        ...

    def read(self, tau: float, dt: float) -> None:
        """Read the FMU's outputs after these seconds, and count work."""
        ...

    def result(self) -> dict[str, Vector]:
        """Return the bond's outputs at the end of the step."""
        ...

    @property
    def state(self) -> Vector:
        """The state between steps beside the FMU's."""
        ...

    @state.setter
    def state(self, state: Vector) -> None: ...


class _Output:
    """A quantity of the FMU, read in SI units."""

    def __init__(self, instance: Instance, quantity: Quantity) -> None:
        self._instance, self._factor = instance, quantity.factor
        self._block = instance.block("Get", quantity.variables)

    def read(self) -> Vector:
        self._instance.transfer(self._block)
        self._block.publish()
        return self._factor * self._block.values


class FmuForceSide:
    """An FMU that takes position and velocity and gives a force."""

    def __init__(
        self,
        instance: Instance,
        bond: BondVariables,
        plan: BondPlan,
        slopes: tuple[Vector, Vector],
        derivatives: Derivatives | None,
    ) -> None:
        """`slopes`: of the force over position and velocity, shape (size, size), renewed by `derivatives`."""
        self._side = ForceSide(bond.side, plan)
        self._position = instance.bond_input(bond.position.variables)
        self._velocity = instance.bond_input(bond.velocity.variables)
        self._factors = bond.position.factor, bond.velocity.factor
        self._force = _Output(instance, bond.force)
        self._derivatives = derivatives
        size = bond.side.size
        self._none = np.zeros(size)
        # the end of the last step: position, velocity and force, then the slopes; NaN before the first
        self._kept = np.concatenate([np.full(3 * size, np.nan), *(slope.ravel() for slope in slopes)])
        self._last = self._kept[: 3 * size].reshape(3, size)
        self._over_position, self._over_velocity = self._kept[3 * size :].reshape(2, size, size)

    def begin(self, inputs: Inputs, h: float) -> None:
        """Read the motion; the force follows where the motion differs from the prediction."""
        self._side.begin(inputs, h)
        position, velocity, force = self._last
        force += self._over_position @ (self._side.position(0.0) - position)
        force += self._over_velocity @ (self._side.velocity(0.0) - velocity)

    def write(self, tau: float, dt: float) -> None:
        """Set the predicted motion."""
        side, end = self._side, tau + dt
        for line, quantity, factor in (
            (self._position, side.position, self._factors[0]),
            (self._velocity, side.velocity, self._factors[1]),
        ):
            line.write(quantity(tau) / factor, quantity(end) / factor, dt)

    def read(self, tau: float, dt: float) -> None:
        """Add the mean force."""
        side, (position, velocity, before) = self._side, self._last
        end = tau + dt
        force = self._force.read()
        position[:], velocity[:] = side.position(end), side.velocity(end)
        if not self._position.is_exact:
            force += self._over_position @ (0.5 * (position - side.position(tau)))
            force += self._over_velocity @ (0.5 * (velocity - side.velocity(tau)))
        mean = force if np.isnan(before[0]) else 0.5 * (before + force)
        side.add(-mean, self._none, tau + 0.5 * dt, dt)
        before[:] = force

    def result(self) -> dict[str, Vector]:
        """Return the mean force on the motion side, and the work."""
        if self._derivatives is not None:
            self._over_position[:], self._over_velocity[:] = self._derivatives.read()
            self._side.set_stiffness(largest_stiffness(self._over_position))
        return self._side.result(-self._last[2], self._none)

    def initial(self) -> dict[str, Vector]:
        """Return the outputs at time 0."""
        return {self._side.force_port: self._force.read(), self._side.work_port: np.zeros(1)}

    @property
    def state(self) -> Vector:
        """Prediction, work, and the end of the last step."""
        return np.concatenate([self._side.state, self._kept])

    @state.setter
    def state(self, state: Vector) -> None:
        self._side.state, self._kept[:] = np.split(state, [state.size - self._kept.size])


class FmuMotionSide:
    """An FMU that takes a force and gives position and velocity."""

    def __init__(self, instance: Instance, bond: BondVariables, plan: BondPlan) -> None:
        """Read the motion at time 0."""
        self._side = MotionSide(bond.side, plan)
        self._force, self._factor = instance.bond_input(bond.force.variables), bond.force.factor
        self._outputs = _Output(instance, bond.position), _Output(instance, bond.velocity)
        self._position, self._velocity = (output.read() for output in self._outputs)

    def initial(self) -> dict[str, Vector]:
        """Return the outputs at time 0."""
        return self.result()

    def begin(self, inputs: Inputs, h: float) -> None:  # noqa: ARG002
        """Read the reaction."""
        self._side.begin(inputs, self._position, self._velocity)

    def write(self, tau: float, dt: float) -> None:
        """Apply the force."""
        self._applied = self._side.force(tau, self._position, self._velocity)
        value = self._applied / self._factor
        self._force.write(value, value, dt)

    def read(self, tau: float, dt: float) -> None:  # noqa: ARG002
        """Count the work over the displacement."""
        before = self._position
        self._position, self._velocity = (output.read() for output in self._outputs)
        self._side.add(self._applied, self._position - before)

    def result(self) -> dict[str, Vector]:
        """Return the motion, and the work."""
        return self._side.result(self._position, self._velocity)

    @property
    def state(self) -> Vector:
        """The work, and the motion."""
        return np.concatenate([self._side.state, self._position, self._velocity])

    @state.setter
    def state(self, state: Vector) -> None:
        self._side.state, self._position, self._velocity = np.split(state, [1, 1 + self._position.size])
