"""The ports of a guided stitch: those of the stitching expert, and what a person says and sees."""

from __future__ import annotations

from collections.abc import Iterator

from controllers.expert.hand import RobotHand
from controllers.stitching.ports import stitching_ports
from controllers.stitching.stage import COMMANDS, Stage
from robots.dvrk.crtk import base_frame
from schemas.ports import Port
from schemas.ros import BoolMessage, Float64Message, PointStamped, PoseStamped, StringMessage
from schemas.visualization import MarkerArray

__all__ = ["SOURCES", "guided_ports"]

SOURCES = ("", "operator/")
"""Prefixes of what a person says: by a program that is connected, and by hand, with `trocar stitch`."""


def guided_ports(hands: tuple[RobotHand, RobotHand], needle: str) -> Iterator[Port]:
    """Yield the ports for these hands and this needle."""
    yield from stitching_ports(hands, needle)
    for arm in (hand.arm for hand in hands):
        yield Port(
            name=f"{arm}/local/setpoint_cp",
            causality="input",
            type=PoseStamped.ros_type,
            frame=base_frame(arm),
            description="where its controller has the tip: from there it goes on",
        )
        yield _event("input", f"{arm}/following", BoolMessage.ros_type, "whether a person's hand leads it")
    for source in SOURCES:
        yield _event(
            "input", f"{source}pick", PointStamped.ros_type, "a point of the skin: an entry, then its exit"
        )
        yield _event("input", f"{source}command", StringMessage.ros_type, ", ".join(COMMANDS))
    yield Port(
        name="stage",
        causality="output",
        type=Float64Message.ros_type,
        description=", ".join(f"{stage:d} {stage.name.lower()}" for stage in Stage),
    )
    names = ", ".join(stage.name for stage in Stage)
    yield _event("output", "state", StringMessage.ros_type, f"the stage whenever it changes: {names}")
    yield _event("output", "markers", MarkerArray.ros_type, "points, path, plane and banner for the pictures")


def _event(causality: str, name: str, type_: str, meaning: str) -> Port:
    return Port.model_validate(
        {
            "name": name,
            "causality": causality,
            "type": type_,
            "variability": "event",
            "description": meaning,
        }
    )
