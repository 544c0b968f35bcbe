"""The ports of the stitching expert: CRTK clients of the hands, and the engine's ports."""

from __future__ import annotations

from collections.abc import Iterator

from controllers.expert.hand import RobotHand
from controllers.expert.ports import hand_ports
from controllers.ports import measured_joints
from controllers.stitching.phase import StitchPhase
from hub.participant import event_in, event_out, signal_in, signal_out
from robots.dvrk import crtk
from schemas.ports import Port
from schemas.ros import (
    Float64Message,
    PoseStamped,
    PoseWithCovarianceStamped,
    StringMessage,
)

__all__ = ["stitching_ports"]

_NUMBERS = (
    ("phase", "", ", ".join(f"{phase:d} {phase.name.lower()}" for phase in StitchPhase)),
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
        *(signal_out(name, Float64Message, meaning, unit=unit) for name, unit, meaning in _NUMBERS),
        event_out("status", StringMessage, "what begins, and why a stitch is not feasible or has failed"),
    )


def _needle_ports(needle: str) -> Iterator[Port]:
    yield signal_in(f"objects/{needle}/pose", PoseStamped, frame="world")
    yield signal_in(f"objects/{needle}/held_by", Float64Message, "number of the PSM that holds it, 0: none")


def _sight_ports(hand: RobotHand) -> Iterator[Port]:
    yield measured_joints(f"{hand.arm}/measured_js", tuple(joint.name for joint in hand.chain.joints))
    yield event_in(
        f"{hand.arm}/seen",
        PoseWithCovarianceStamped,
        "where a tracker sees the tip; without a source, joints are taken at their word",
        frame=crtk.WORLD_FRAME,
    )
