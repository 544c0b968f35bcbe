"""The bonds of a participant in the rig: the motion of the opposite side, and the check of the work."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, cast

from hub.participant import BondPlan
from hub.testing.contract import require
from schemas.ports import BondSide, bond_ports
from schemas.vectors import Vector

__all__ = ["RigBonds"]

_WORK_TOLERANCE = 0.01
"""Share by which work may differ from force times displacement: an engine may count at sub-steps."""
_LEAST_WORK_J = 1e-12


class RigBonds:
    """The connected bonds of a participant, by name."""

    def __init__(self, sides: Mapping[str, BondSide], plans: Mapping[str, BondPlan]) -> None:
        self._sides = {name: sides[name] for name in plans}
        self._plans = plans
        self.work = dict.fromkeys(plans, 0.0)
        """The work (J) of each bond since the start."""

    def move(self, values: dict[str, Any], seconds: float) -> None:
        """Move the opposite side of each force side in `values`, the inputs, with its velocity."""
        for _, side in self._of_side("force"):
            position, velocity, _ = _ports(side)
            moved = cast("Vector", values[position]).copy()
            moved[: side.linear] += cast("Vector", values[velocity])[: side.linear] * seconds
            values[position] = moved

    def positions(self, outputs: Mapping[str, Any]) -> dict[str, Vector]:
        """Return the position of every motion side in `outputs`, shape (size,) or (7,)."""
        return {name: cast("Vector", outputs[_ports(side)[0]]) for name, side in self._of_side("motion")}

    def check_work(
        self,
        outputs: Mapping[str, Any],
        inputs: Mapping[str, Any],
        before: Mapping[str, Vector],
        seconds: float,
    ) -> None:
        """Check the work of each bond in a step of `seconds`; `before`: `positions` at the start."""
        for name, plan in self._plans.items():
            side = self._sides[name]
            position, velocity, force = _ports(side)
            total = float(outputs[f"{name}/work"][0])
            done, self.work[name] = total - self.work[name], total
            if side.side == "force" and plan.mean and plan.prediction == "velocity":
                expected = -float(outputs[force] @ inputs[velocity]) * seconds
                _check_equal(name, done, expected, "minus its force times the way of the other side")
            elif side.side == "motion" and plan.correction is None:
                linear, pushed = side.linear, cast("Vector", inputs[force])
                moved = cast("Vector", outputs[position])[:linear] - before[name][:linear]
                if not pushed[linear:].any():
                    expected = -float(pushed[:linear] @ moved)
                    _check_equal(name, done, expected, "minus the force on it times its way")

    def _of_side(self, word: str) -> Iterator[tuple[str, BondSide]]:
        return ((name, side) for name, side in self._sides.items() if side.side == word)


def _ports(side: BondSide) -> tuple[str, str, str]:
    """Return the names of the ports of position, velocity and force."""
    position, velocity, force = (port.name for port in bond_ports(side))
    return position, velocity, force


def _check_equal(name: str, done: float, expected: float, words: str) -> None:
    close = abs(done - expected) <= _WORK_TOLERANCE * abs(expected) + _LEAST_WORK_J
    require(
        close, f"the work of bond '{name}' in a step is {words}: {expected:.6g} J, but it is {done:.6g} J"
    )
