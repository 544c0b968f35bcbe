"""Ports of the clip-and-cut routine: CRTK for each hand, sight and events of the organs, progress."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from controllers.cholecystectomy.params import ClipAndCutParams
from controllers.cholecystectomy.sub_task import FAILURES, Step, SubTask
from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from controllers.expert.ports import hand_ports
from controllers.ports import measured_joints
from hub.participant import event_in, event_out, signal_in, signal_out
from schemas.ports import Port
from schemas.ros import EmptyMessage, Float64Message, StringMessage
from schemas.trocar_msgs import SoftBodyState, TissueEvent, TubeLine

__all__ = ["PROGRESS", "routine_ports"]

PROGRESS = {
    "sub_task": ", ".join(f"{task:d} {task.name.lower()}" for task in SubTask),
    "step": ", ".join(f"{step:d} {step.name.lower()}" for step in Step),
    "clips": "how many clips are closed on the tubes",
    "cuts": "how many tubes are parted",
    "recoveries": "how often a sub-task was tried again",
    "pulled": "way of the gallbladder, m",
    "done": "1 when both tubes are clipped and parted",
    "failed": "1 when it has given up; `status` says why",
    "failure": ", ".join(f"{failure:d} {words}" for failure, words in FAILURES.items()),
}


def routine_ports(params: ClipAndCutParams, hands: Iterable[SurgeonHand]) -> tuple[Port, ...]:
    """Return the ports for these parameters and hands."""
    organs = dict.fromkeys((params.gallbladder, *params.avoid))
    return (
        *(port for hand in hands for port in _arm_ports(hand)),
        *(port for tube in params.tubes for port in _tube_ports(tube)),
        *(signal_in(f"{organ}/nodes", SoftBodyState, frame="world") for organ in organs),
        signal_in(f"{params.grasper}/held", Float64Message, "1 while tissue is held, else 0"),
        signal_in(f"{params.grasper}/pull", size=3, unit="N", frame="world"),
        event_out(f"{params.applier}/clip", EmptyMessage, "closes a clip on what is between the jaws"),
        *(signal_out(name, Float64Message, meaning) for name, meaning in PROGRESS.items()),
        event_out("instruction", StringMessage, "the sub-task that begins, as a request to a policy"),
        event_out("status", StringMessage, "what begins, what is tried again, and why it has given up"),
    )


def _arm_ports(hand: SurgeonHand) -> Iterator[Port]:
    yield from hand_ports(hand.arm)
    yield measured_joints(f"{hand.arm}/measured_js", tuple(joint.name for joint in hand.chain.joints))


def _tube_ports(tube: str) -> Iterator[Port]:
    yield signal_in(f"{tube}/line", TubeLine, "present middle line", frame="world")
    yield event_in(f"{tube}/events", TissueEvent, frame="world")
