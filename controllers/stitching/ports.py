"""The ports of the stitching expert: those of CRTK's clients for the hands, and of the engine."""

from __future__ import annotations

from collections.abc import Iterator

from controllers.expert.hand import RobotHand
from controllers.expert.ports import hand_ports
from controllers.stitching.phase import Phase
from robots.dvrk import crtk
from schemas.ports import Port
from schemas.ros import (
    Float64Message,
    JointState,
    PoseStamped,
    PoseWithCovarianceStamped,
    StringMessage,
)

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


def stitching_ports(hands: tuple[RobotHand, RobotHand], needle: str) -> tuple[Port, ...]:
    """Return the ports for these hands and this needle."""
    return (
        *(port for hand in hands for port in (*hand_ports(hand.arm), *_sight_ports(hand))),
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


def _sight_ports(hand: RobotHand) -> Iterator[Port]:
    yield Port(
        name=f"{hand.arm}/measured_js",
        causality="input",
        type=JointState.ros_type,
        names=tuple(joint.name for joint in hand.chain.joints),
        fields=crtk.MEASURED,
    )
    yield Port(
        name=f"{hand.arm}/seen",
        causality="input",
        type=PoseWithCovarianceStamped.ros_type,
        variability="event",
        frame=crtk.WORLD_FRAME,
        description="where a tracker sees the tip; without a source, joints are taken at their word",
    )
