"""Slopes of a bond in an FMU: by directional derivatives, or measured with instances of their own."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from contextlib import closing

import numpy as np

from engines.fmu.bond_variables import BondVariables, Quantity
from engines.fmu.description import Description
from engines.fmu.instance import Instance
from engines.fmu.variables import Variable
from schemas.vectors import Vector

__all__ = ["Derivatives", "largest_stiffness", "measured_mass", "measured_slopes"]

_DISPLACEMENT, _SPEED, _FORCE = 1e-6, 1e-3, 1e-3
"""m or rad, m/s or rad/s, N or N m: small for a force or an instrument, far above rounding."""


class Derivatives:
    """Slopes of a bond's force over position and velocity, by the FMU's directional derivatives."""

    def __init__(self, instance: Instance, bond: BondVariables) -> None:
        """Prepare the calls; see `offered`."""
        self._instance, self._size = instance, bond.side.size
        self._forces, self._knowns = _references(bond.force), (bond.position, bond.velocity)
        self._result = (ctypes.c_double * self._size)()
        self._scales = [bond.force.factor / known.factor for known in self._knowns]

    @staticmethod
    def offered(instance: Instance, description: Description, bond: BondVariables) -> bool:
        """Return whether the FMU has directional derivatives of scalars."""
        scalars = all(variable.size == 1 for variable in bond.inputs + bond.force.variables)
        has = description.interface.providesDirectionalDerivative
        return has and scalars and instance.library.has(f"{instance.prefix}GetDirectionalDerivative")

    def read(self) -> tuple[Vector, Vector]:
        """Return the slopes over position (N/m, N m/rad) and velocity, shape (size, size), at present."""
        position, velocity = (
            np.column_stack([self._column(one) for one in known.variables]) * scale
            for known, scale in zip(self._knowns, self._scales, strict=True)
        )
        return position, velocity

    def _column(self, known: Variable) -> list[float]:
        """Return the derivatives of the forces by an input."""
        seed, size, instance = (ctypes.c_double * 1)(1.0), self._size, self._instance
        where = self._forces, size, (ctypes.c_uint * 1)(known.reference), 1
        arguments = (seed, 1, self._result, size) if instance.counted else (seed, self._result)
        instance.call("GetDirectionalDerivative", *where, *arguments)
        return list(self._result)


def _references(quantity: Quantity) -> ctypes.Array[ctypes.c_uint]:
    references = [variable.reference for variable in quantity.variables]
    return (ctypes.c_uint * len(references))(*references)


def largest_stiffness(over_position: Vector) -> float:
    """Return the largest fall of a force over the position, N/m or N m/rad, of its slopes."""
    return max(0.0, float(np.linalg.eigvalsh(-0.5 * (over_position + over_position.T))[-1]))


def measured_slopes(
    start: Callable[[], Instance], bond: BondVariables, step_ns: int
) -> tuple[Vector, Vector]:
    """Return the slopes of the force over position and velocity, shape (size, size), at time 0.

    Each degree of freedom is displaced in an instance of its own, returned by `start` at time 0; the force is
    read after a step of `step_ns`.
    """
    zero, unit = np.zeros(bond.side.size), np.eye(bond.side.size)

    def force(position: Vector, velocity: Vector) -> Vector:
        with closing(start()) as instance:
            shifts = (bond.position, position), (bond.velocity, velocity)
            return _respond(instance, shifts, bond.force, step_ns)

    at_rest = force(zero, zero)
    over_position = [(force(_DISPLACEMENT * way, zero) - at_rest) / _DISPLACEMENT for way in unit]
    over_velocity = [(force(zero, _SPEED * way) - at_rest) / _SPEED for way in unit]
    return np.column_stack(over_position), np.column_stack(over_velocity)


def measured_mass(start: Callable[[], Instance], bond: BondVariables, step_ns: int) -> float | None:
    """Return the least mass (kg, kg m^2) under a force at time 0, or None if no force moves the FMU.

    A force in each degree of freedom acts for a step of `step_ns`, in an instance of its own.
    """

    def speed(force: Vector) -> Vector:
        with closing(start()) as instance:
            return _respond(instance, [(bond.force, force)], bond.velocity, step_ns)

    at_rest = speed(np.zeros(bond.side.size))
    impulse = _FORCE * step_ns * 1e-9
    mobility = np.column_stack([(speed(_FORCE * way) - at_rest) / impulse for way in np.eye(bond.side.size)])
    most = float(np.linalg.eigvalsh(0.5 * (mobility + mobility.T))[-1])
    return 1.0 / most if most > 0.0 else None


def _respond(
    instance: Instance, shifts: Sequence[tuple[Quantity, Vector]], output: Quantity, step_ns: int
) -> Vector:
    """Shift inputs (in SI units), take a step from time 0, and return an output in SI units."""
    for quantity, shift in shifts:
        value = _read(instance, quantity) + shift / quantity.factor
        instance.bond_input(quantity.variables).write(value, value, step_ns * 1e-9)
    instance.advance(0, step_ns)
    return output.factor * _read(instance, output)


def _read(instance: Instance, quantity: Quantity) -> Vector:
    """Return the values of a quantity in the FMU's unit."""
    block = instance.block("Get", quantity.variables)
    instance.transfer(block)
    return block.values
