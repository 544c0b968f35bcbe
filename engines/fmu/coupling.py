"""Makes the bonds of an FMU: slopes and masses as stated, as the FMU has them, or as measured."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from engines.fmu.bond_variables import BondVariables
from engines.fmu.bonds import FmuForceSide, FmuMotionSide, FmuSide
from engines.fmu.description import Description
from engines.fmu.instance import Instance
from engines.fmu.slopes import Derivatives, largest_stiffness, measured_mass, measured_slopes
from hub.participant import BondPlan
from schemas.ports import BondSide
from schemas.vectors import Vector

__all__ = ["Coupling"]

_log = logging.getLogger(__name__)


class Coupling:
    """Couples the bonds of an FMU at time 0."""

    def __init__(
        self,
        instance: Instance,
        description: Description,
        step_ns: int,
        start: Callable[[], Instance],
    ) -> None:
        """`step_ns`: communication step; `start` returns another instance at time 0, for measurements."""
        self._instance, self._description = instance, description
        self._step_ns, self._start = step_ns, start
        self._measures = not description.interface.canBeInstantiatedOnlyOncePerProcess

    def couple(self, bond: BondVariables, plan: BondPlan) -> tuple[FmuSide, BondSide]:
        """Return the running side of `bond`, and the declared side with the numbers for its rule."""
        if bond.side.side == "motion":
            mass = bond.side.effective_mass
            if mass is None and self._is_measured(bond, "effective_mass"):
                mass = measured_mass(self._start, bond, self._step_ns)
            known = bond.side.model_copy(update={"effective_mass": mass})
            return FmuMotionSide(self._instance, bond, plan), known
        derivatives = None
        if Derivatives.offered(self._instance, self._description, bond):
            derivatives = Derivatives(self._instance, bond)
        over_position, over_velocity = slopes = self._slopes(bond, derivatives)
        numbers = {"stiffness": largest_stiffness(over_position), "damping": largest_stiffness(over_velocity)}
        numbers |= {name: stated for name in numbers if (stated := getattr(bond.side, name)) is not None}
        known = bond.side.model_copy(update=numbers | {"contact_stiffness": numbers["stiffness"]})
        return FmuForceSide(self._instance, bond, plan, slopes, derivatives), known

    def _slopes(self, bond: BondVariables, derivatives: Derivatives | None) -> tuple[Vector, Vector]:
        """Return the slopes of the force over position and velocity, shape (size, size)."""
        if derivatives is not None:
            return derivatives.read()
        if bond.side.stiffness is None and self._is_measured(bond, "stiffness"):
            return measured_slopes(self._start, bond, self._step_ns)
        unit = np.eye(bond.side.size)
        return -(bond.side.stiffness or 0.0) * unit, -(bond.side.damping or 0.0) * unit

    def _is_measured(self, bond: BondVariables, number: str) -> bool:
        if not self._measures:
            _log.warning(
                "%s: the step of bond '%s' is not checked: the FMU can be instantiated only once, so that"
                " nothing is measured; state '%s'",
                self._description.path,
                bond.side.name,
                number,
            )
        return self._measures
