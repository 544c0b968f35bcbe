"""The ports of the suturing pad."""

from __future__ import annotations

from engines.suture_pad.channel import Phase
from robots.training.threads import THREAD
from schemas.ports import BondSide, Port
from schemas.ros import Float64Message
from schemas.trocar_msgs import SoftBodyState, TaskEvent

__all__ = ["BOND", "EVENTS", "SKIN", "THREAD_NUMBERS", "bond_side", "pad_ports"]

BOND = "needle"
SKIN = "skin"
EVENTS = ("entered", "exited", "withdrawn", "pulled out")
"""The tip has broken through the skin; has come out again; the needle is out the way it came, or all through.
"""
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
"""Outputs that only a pad has whose needle has a thread."""


def pad_ports(node_period_ns: int, *, thread: bool) -> tuple[Port, ...]:
    """Return all ports but those of the bond."""
    number = Float64Message.ros_type
    return (
        *(
            Port(name=name, causality="output", type=number, unit=unit, description=meaning)
            for name, unit, meaning in _NUMBERS + (_OF_THREAD if thread else ())
        ),
        *(
            Port(
                name=name,
                causality="output",
                size=3,
                unit="m",
                description=f"where the needle went {way} last, on the skin at rest, in the world",
            )
            for name, way in (("entry", "in"), ("exit", "out"))
        ),
        Port(
            name="events",
            causality="output",
            type=TaskEvent.ros_type,
            variability="event",
            description=f"{', '.join(EVENTS)}: with the nearest hole, and the force of the tip just before",
        ),
        *(
            Port(
                name=f"{body}/nodes",
                causality="output",
                type=SoftBodyState.ros_type,
                frame="world",
                period_ns=node_period_ns,
                description=f"the {body}, to be drawn; its triangles come with the first",
            )
            for body in ((SKIN, THREAD) if thread else (SKIN,))
        ),
    )


def bond_side() -> BondSide:
    """Return the bond: base, middle and tip of the needle, in the world."""
    return BondSide(name=BOND, side="force", dof=3, points=3, frame="world")
