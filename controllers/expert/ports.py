"""Ports of the expert: CRTK for each hand, poses and holders for each object."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from controllers.expert.hand import HandPhase
from robots.dvrk import crtk
from schemas.ports import Port
from schemas.ros import Float64Message, JointState, PoseStamped, StringMessage

__all__ = ["EVENTS", "PROGRESS", "expert_ports", "hand_ports"]

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
    number = Float64Message.ros_type
    return (
        *(port for arm in arms for port in (*hand_ports(arm), _phase_port(arm))),
        *(
            port
            for thing in things
            for port in (
                Port(
                    name=f"objects/{thing}/pose", causality="input", type=PoseStamped.ros_type, frame="world"
                ),
                Port(name=f"objects/{thing}/held_by", causality="input", type=number),
            )
        ),
        *(
            Port(name=name, causality="output", type=number, description=meaning)
            for name, meaning in PROGRESS.items()
        ),
        Port(
            name="status",
            causality="output",
            type=StringMessage.ros_type,
            variability="event",
            description="which thing is left where it is, and why, as soon as that is known",
        ),
    )


def hand_ports(arm: str) -> Iterator[Port]:
    """Yield the ports of one hand of any expert."""
    pose, joints = PoseStamped.ros_type, JointState.ros_type
    yield Port(name=f"{arm}/local/measured_cp", causality="input", type=pose, frame=crtk.base_frame(arm))
    yield Port(
        name=f"{arm}/jaw/measured_js", causality="input", type=joints, names=("jaw",), fields=crtk.MEASURED
    )
    for event in EVENTS:
        yield Port(name=f"{arm}/{event}", causality="input", type=StringMessage.ros_type, variability="event")
    yield Port(name=f"{arm}/servo_cp", causality="output", type=pose, variability="event")
    yield Port(name=f"{arm}/jaw/move_jp", causality="output", type=joints, variability="event")


def _phase_port(arm: str) -> Port:
    return Port(name=f"{arm}/phase", causality="output", type=Float64Message.ros_type, description=_PHASES)
