"""The ports of the stitching expert: those of CRTK's clients for the hands, and of the engine."""

from __future__ import annotations

from collections.abc import Iterator

from controllers.expert.ports import hand_ports
from controllers.stitching.phase import Phase
from schemas.ports import Port
from schemas.ros import Float64Message, PoseStamped, StringMessage

__all__ = ["stitching_ports"]

_NUMBERS = (
    ("phase", "", ", ".join(f"{phase:d} {phase.name.lower()}" for phase in Phase)),
    ("stitch", "", "number of the pair of holes at work"),
    ("made", "", "how many stitches are made"),
    ("angle", "rad", "of the needle's tip on its way: 0 towards the side it comes from, a quarter turn down"),
    ("deviation", "m", "of the measured needle's middle and ends from their way, the largest"),
    ("done", "", "1 when all stitches are made"),
    ("failed", "", "1 when it has given up; `status` says why"),
)


def stitching_ports(driver: str, puller: str, needle: str) -> tuple[Port, ...]:
    """Return the ports for these arms and this needle."""
    return (
        *(port for arm in (driver, puller) for port in hand_ports(arm)),
        *_needle_ports(needle),
        *(
            Port(name=name, causality="output", type=Float64Message.ros_type, unit=unit, description=meaning)
            for name, unit, meaning in _NUMBERS
        ),
        Port(
            name="status",
            causality="output",
            type=StringMessage.ros_type,
            variability="event",
            description="what begins, and why a stitch is not feasible or has failed",
        ),
    )


def _needle_ports(needle: str) -> Iterator[Port]:
    yield Port(name=f"objects/{needle}/pose", causality="input", type=PoseStamped.ros_type, frame="world")
    yield Port(
        name=f"objects/{needle}/held_by",
        causality="input",
        type=Float64Message.ros_type,
        description="number of the PSM that holds it, 0: none",
    )
