"""The ports of the suturing pad."""

from __future__ import annotations

from engines.suture_pad.channel import Phase
from hub.participant import event_out, signal_out
from robots.training.threads import THREAD
from schemas.ports import BondSide, Port
from schemas.ros import Float64Message
from schemas.trocar_msgs import SoftBodyState, TaskEvent

__all__ = ["BOND", "EVENTS", "SKIN", "THREAD_NUMBERS", "bond_side", "pad_ports"]

BOND = "needle"
SKIN = "skin"
EVENTS = ("entered", "exited", "withdrawn", "pulled out")
"""The tip has broken through the skin; has come out again; the needle is out by the entry, or all through."""
_NUMBERS = (
    ("phase", "", ", ".join(f"{phase:d} {phase.name.lower()}" for phase in Phase)),
    ("insertion", "m", "way of the tip along the arc since it has broken through the skin"),
    ("depth", "m", "of the tip below the skin at rest, or of the deepest point of its channel; 0: outside"),
    ("resistance", "N", "size of the force on the needle"),
    ("tip_force", "N", "of skin or tissue against the tip alone"),
    ("trauma", "m^2", "area between needle and channel now: by how much it pushes the tissue aside"),
    ("stitches", "", "how many needles have been pulled all through"),
)
_OF_THREAD = (
    ("thread_pull", "N", "size of the force of the thread on the needle's base"),
    ("passages", "", "how many channels the thread runs through"),
)
THREAD_NUMBERS = tuple(name for name, _, _ in _OF_THREAD)
"""Outputs of a pad with a threaded needle only."""


def pad_ports(node_period_ns: int, *, thread: bool) -> tuple[Port, ...]:
    """Return all ports but the ports of the bond."""
    numbers = _NUMBERS + (_OF_THREAD if thread else ())
    broken = f"{', '.join(EVENTS)}: with the nearest hole, and the force of the tip just before"
    return (
        *(signal_out(name, Float64Message, meaning, unit=unit) for name, unit, meaning in numbers),
        *(_hole_port(name, way) for name, way in (("entry", "in"), ("exit", "out"))),
        event_out("events", TaskEvent, broken),
        *(_nodes(body, node_period_ns) for body in ((SKIN, THREAD) if thread else (SKIN,))),
    )


def _hole_port(name: str, way: str) -> Port:
    meaning = f"where the needle went {way} last, on the skin at rest, in the world"
    return signal_out(name, description=meaning, size=3, unit="m")


def _nodes(body: str, period_ns: int) -> Port:
    meaning = f"the {body}, to be drawn; its triangles come with the first"
    return signal_out(f"{body}/nodes", SoftBodyState, meaning, frame="world", period_ns=period_ns)


def bond_side() -> BondSide:
    """Return the bond: base, middle and tip of the needle, in the world."""
    return BondSide(name=BOND, side="force", dof=3, points=3, frame="world")
