"""Seats of instruments on arms with spares: which instrument is in an arm, by the positions of the joints."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

from engines.mujoco.model.names import PARKED_M, SEAT

if TYPE_CHECKING:
    import mujoco

__all__ = ["Tip", "arm_tips", "is_engaged", "seat_place"]


class Tip(NamedTuple):
    """Tip of an instrument in a model."""

    site: int
    seat: int | None
    """Place of the seat in `qpos`; None: an arm without spares."""

    def is_engaged(self, data: mujoco.MjData) -> bool:
        """Return whether the instrument is in the arm."""
        return is_engaged(data, self.seat)


def arm_tips(owners: Iterable[str], model: mujoco.MjModel) -> list[Tip]:
    """Return the tips of an arm's instruments, given the prefixes of their names."""
    return [Tip(model.site(f"{owner}/tip").id, seat_place(model, owner)) for owner in owners]


def seat_place(model: mujoco.MjModel, owner: str) -> int | None:
    """Return the place of the seat of an instrument in `qpos`; None for an arm without spares."""
    for i in range(model.njnt):
        if model.joint(i).name == f"{owner}/{SEAT}":
            return int(model.jnt_qposadr[i])
    return None


def is_engaged(data: mujoco.MjData, seat: int | None) -> bool:
    """Return whether an instrument is in its arm: the seat, by place in `qpos`, is not far away."""
    return seat is None or bool(data.qpos[seat] > -0.5 * PARKED_M)
