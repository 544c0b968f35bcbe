"""Ports of the expert: CRTK for each hand, poses and holders for each object."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from controllers.expert.hand import HandPhase
from controllers.ports import measured_joints
from hub.participant import event_in, event_out, signal_in, signal_out
from robots.dvrk import crtk
from schemas.ports import Port
from schemas.ros import Float64Message, JointState, PoseStamped, StringMessage

__all__ = ["EVENTS", "PROGRESS", "arm_ports", "expert_ports", "hand_ports"]

EVENTS = ("error", "warning")
"""Refusals of the motion controller."""
PROGRESS = {
    "done": "1 when everything is where it belongs, in all legs",
    "over": "1 when all is done, or nothing more can be",
    "leg": "how often everything has been brought over, or back",
    "placed": "how many things are where they belong",
    "attempts": "how often a jaw has closed on a thing",
    "dropped": "how often a thing was not held any more on its way",
    "not_reachable": "how many things are left because no hand has a way to take them",
    "lost": "how many things have fallen off the table",
    "blocked": "how many things are left because jaws have closed on them too often",
}
_PHASES = ", ".join(f"{phase:d} {phase.name.lower()}" for phase in HandPhase)


def expert_ports(arms: Iterable[str], things: Iterable[str]) -> tuple[Port, ...]:
    """Return the ports for these arms and things."""
    return (
        *(port for arm in arms for port in (*hand_ports(arm), _phase_port(arm))),
        *(
            port
            for thing in things
            for port in (
                signal_in(f"objects/{thing}/pose", PoseStamped, frame="world"),
                signal_in(f"objects/{thing}/held_by", Float64Message),
            )
        ),
        *(signal_out(name, Float64Message, meaning) for name, meaning in PROGRESS.items()),
        event_out(
            "status", StringMessage, "which thing is left where it is, and why, as soon as that is known"
        ),
    )


def hand_ports(arm: str) -> Iterator[Port]:
    """Yield the ports of one hand of any expert."""
    yield from arm_ports(arm)
    yield measured_joints(f"{arm}/jaw/measured_js", ("jaw",))
    yield event_out(f"{arm}/jaw/move_jp", JointState)


def arm_ports(arm: str) -> Iterator[Port]:
    """Yield the ports of one hand whose instrument has no jaw."""
    yield signal_in(f"{arm}/local/measured_cp", PoseStamped, frame=crtk.base_frame(arm))
    for event in EVENTS:
        yield event_in(f"{arm}/{event}", StringMessage)
    yield event_out(f"{arm}/servo_cp", PoseStamped)


def _phase_port(arm: str) -> Port:
    return signal_out(f"{arm}/phase", Float64Message, _PHASES)
