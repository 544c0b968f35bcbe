"""Ports of the dissection routine: CRTK for both hands, sight of the tissue, power, progress."""

from __future__ import annotations

from collections.abc import Iterator

from controllers.cholecystectomy.surgeon_hand import SurgeonHand
from controllers.dissection.hook_hand import HookHand
from controllers.dissection.params import DissectionParams
from controllers.dissection.step import FAILURES, Step
from controllers.expert.ports import arm_ports, hand_ports
from controllers.ports import measured_joints
from hub.participant import event_out, signal_in, signal_out
from schemas.ports import Port
from schemas.ros import Float64Message, StringMessage
from schemas.trocar_msgs import SoftBodyState, TiedPlaces

__all__ = ["PROGRESS", "dissection_ports"]

PROGRESS = {
    "step": ", ".join(f"{step:d} {step.name.lower()}" for step in Step),
    "ties": "how many places still hang together",
    "recoveries": "how often a grasp or a place was tried again",
    "pulled": "way of the grasper since its grasp, m",
    "done": "1 when all is free",
    "failed": "1 when it has given up; `status` says why",
    "failure": ", ".join(f"{failure:d} {words}" for failure, words in FAILURES.items()),
}


def dissection_ports(params: DissectionParams, hook: HookHand, grasper: SurgeonHand) -> Iterator[Port]:
    """Yield the ports for these parameters and hands."""
    yield from arm_ports(hook.arm)
    yield from hand_ports(grasper.arm)
    for hand in (hook, grasper):
        yield measured_joints(f"{hand.arm}/measured_js", tuple(joint.name for joint in hand.chain.joints))
    for organ in dict.fromkeys((params.gallbladder, *params.avoid)):
        yield signal_in(f"{organ}/nodes", SoftBodyState, frame="world")
    yield signal_in(f"{params.plate}/ties", TiedPlaces, frame="world")
    for name in params.fat:
        yield signal_in(f"{name}/ties", TiedPlaces, frame="world", start=())
    seen = {params.gallbladder, *params.avoid}
    for organ in dict.fromkeys((params.sheet, *params.spare)):
        if organ not in seen:
            yield signal_in(f"{organ}/nodes", SoftBodyState, frame="world", start=())
    yield signal_in(f"{params.plate}/lower_third", start=(0.0,))
    yield signal_in(f"{grasper.arm}/held", Float64Message, "1 while tissue is held, else 0")
    yield signal_in(f"{grasper.arm}/pull", size=3, unit="N", frame="world")
    yield signal_in(f"{hook.arm}/delivered", description="heat given to tissue", unit="J")
    yield signal_out(f"{hook.arm}/energy", description="power of the generator", unit="W")
    for name, meaning in PROGRESS.items():
        yield signal_out(name, Float64Message, meaning)
    yield event_out("status", StringMessage, "what begins, what is tried again, and why it has given up")
