"""The ports of a guided stitch: the stitching expert's, and a person's words and markers."""

from __future__ import annotations

from collections.abc import Iterator

from controllers.expert.hand import RobotHand
from controllers.stitching.ports import stitching_ports
from controllers.stitching.stage import COMMANDS, Stage
from hub.participant import event_in, event_out, signal_in, signal_out
from robots.dvrk.crtk import base_frame
from schemas.ports import Port
from schemas.ros import BoolMessage, Float64Message, PointStamped, PoseStamped, StringMessage
from schemas.visualization import MarkerArray

__all__ = ["SOURCES", "guided_ports"]

SOURCES = ("", "operator/")
"""Prefixes of a person's ports: for a connected program, and by hand, with `trocar stitch`."""


def guided_ports(hands: tuple[RobotHand, RobotHand], needle: str) -> Iterator[Port]:
    """Yield the ports for these hands and this needle."""
    yield from stitching_ports(hands, needle)
    setpoint = "where its controller has the tip: from there it goes on"
    for arm in (hand.arm for hand in hands):
        yield signal_in(f"{arm}/local/setpoint_cp", PoseStamped, setpoint, frame=base_frame(arm))
        yield event_in(f"{arm}/following", BoolMessage, "whether a person's hand leads it")
    for source in SOURCES:
        yield event_in(f"{source}pick", PointStamped, "a point of the skin: an entry, then its exit")
        yield event_in(f"{source}command", StringMessage, ", ".join(COMMANDS))
    yield signal_out("stage", Float64Message, ", ".join(f"{stage:d} {stage.name.lower()}" for stage in Stage))
    names = ", ".join(stage.name for stage in Stage)
    yield event_out("state", StringMessage, f"the stage whenever it changes: {names}")
    yield event_out("markers", MarkerArray, "points, path, plane and banner for the pictures")
