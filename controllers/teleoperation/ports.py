"""The ports of a teleoperation: hand and buttons, arm, and contact for the hand."""

from __future__ import annotations

from controllers.ports import NO_POSE, NO_TWIST, NO_WRENCH, measured_joints
from controllers.teleoperation.params import TeleoperationParams
from hub.participant import event_in, event_out, signal_in, signal_out
from robots.dvrk import crtk
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.ros import (
    BoolMessage,
    EmptyMessage,
    Float64Message,
    JointState,
    Joy,
    PoseStamped,
    StringMessage,
    TwistStamped,
    WrenchStamped,
)
from schemas.trocar_msgs import ContactModel

__all__ = ["NO_GRIPPER", "has_clips", "jaw_joints", "teleoperation_ports"]

_LEAST_SCALE = 0.05
"""Least scale offered to people while the session runs."""
NO_GRIPPER = -1.0
"""Value of an unconnected `gripper`: the button leads the jaw."""


def teleoperation_ports(params: TeleoperationParams) -> tuple[Port, ...]:
    """Return the ports of a hand leading an arm."""
    return (*_hand(params), *_arm(params), *_jaw(params), *_streams(params), *_published_ports(params))


def _hand(p: TeleoperationParams) -> tuple[Port, ...]:
    clutch = "leads the arm while it is held" if p.engage == "held" else "clutch"
    still = NO_TWIST if p.law == "pose" else None
    buttons = (
        f"button {p.buttons.clutch}: {clutch}; button {p.buttons.jaw}: closes the jaw; button"
        f" {p.buttons.pedal}: power or suction; button {p.buttons.rinse}: saline"
    )
    gripper = "of the hand, 0 closed .. 1 open; negative: none, the button leads the jaw"
    scale = "metres of the tip per metre of the hand, above 0 and up to 1"
    twist = "of the hand, for `law: velocity`"
    return (
        signal_in("master", PoseStamped, "pose of the hand", max_age_ns=p.max_age),
        signal_in("master_twist", TwistStamped, twist, max_age_ns=p.max_age, start=still),
        event_in("buttons", Joy, buttons),
        signal_in("gripper", Float64Message, gripper, start=(NO_GRIPPER,)),
        signal_in("scale", Float64Message, scale, start=(p.scale,), limits=(min(_LEAST_SCALE, p.scale), 1.0)),
        *(
            event_in(f"lock_{what}", BoolMessage, f"whether the tip keeps its {kept}")
            for what, kept in (("rotation", "orientation"), ("translation", "position"))
            if p.law == "pose"
        ),
    )


def _arm(p: TeleoperationParams) -> tuple[Port, ...]:
    base, names = crtk.base_frame(p.arm), tuple(joint.name for joint in p.chain.joints)
    seen = p.view != "base"
    measured = (
        "where the command starts: at the first step, whenever the arm gets ready and, of an arm that"
        " publishes its operating state, whenever the hand takes over; of a motion controller its setpoint_js"
    )
    state = (
        "of the arm: it follows while ENABLED and homed; an arm that publishes it may be commanded by others"
        " while it does not follow"
    )
    stand = (
        "of the arm's base frame in the camera's, unless `view: base`: the motion controller's"
        " SUJ/<arm>/measured_cp"
    )
    frame, start = (crtk.CAMERA_FRAME, None) if seen else ("", NO_POSE)
    held = (
        "of the arm, 0 the mounted one; -1: it is exchanged, and the arm holds; <arm>/instrument of `motion`"
    )
    return (
        *((signal_in("instrument", Float64Message, held),) if len(p.variants) > 1 else ()),
        measured_joints("measured_js", names, measured, start=p.start),
        event_in("operating_state", OperatingState, state),
        signal_in("base_in_view", PoseStamped, stand, frame=frame, start=start),
        *(
            signal_in(
                name, WrenchStamped, f"of {what} on the instrument, at the tip", frame=base, start=NO_WRENCH
            )
            for name, what in (("tip_wrench", "tissue"), ("rigid_wrench", "rigid things"))
        ),
        signal_out("servo_jp", JointState, "command to the arm's joint servos", names=names),
        signal_out("goal_cp", PoseStamped, "where the tip is commanded to be", frame=base),
    )


def jaw_joints(params: TeleoperationParams) -> tuple[str, ...]:
    """Return the names of the jaw's joints, of the first instrument with a jaw that the arm may hold."""
    joints = (tuple(joint.name for joint in one.tool.jaw_joints) for one in params.variants)
    return next(filter(None, joints), ())


def _jaw(p: TeleoperationParams) -> tuple[Port, ...]:
    names = jaw_joints(p)
    if not names:
        return ()
    command = "command to the jaw; its roller stays where it is"
    return (
        measured_joints("jaw/measured_js", names, "where the jaw starts, as measured_js", start=(p.jaw,)),
        signal_out("jaw/servo_jp", JointState, command, names=names),
    )


def _streams(p: TeleoperationParams) -> tuple[Port, ...]:
    names = [f"{p.arm}/servo_jp", *([f"{p.arm}/jaw/servo_jp"] if jaw_joints(p) else [])]
    meaning = (
        "the command to the arm's motion controller, at every step while it follows; otherwise nothing, so"
        " that others may move the arm"
    )
    return tuple(event_out(name, JointState, meaning) for name in names)


def _published_ports(p: TeleoperationParams) -> tuple[Port, ...]:
    contact, phases = (
        "for the hand, in the master's base frame",
        "DISABLED, CLUTCHED, ALIGNING or ENABLED: whenever it changes",
    )
    return (
        signal_out("contact", ContactModel, contact, period_ns=p.contact_period),
        signal_out("following", BoolMessage, "whether the arm follows the hand"),
        event_out("state", StringMessage, phases),
        event_out("warning", StringMessage, "why the arm holds, and what to do"),
        *((event_out("clip", EmptyMessage, "the hand has shut the jaw"),) if has_clips(p) else ()),
    )


def has_clips(params: TeleoperationParams) -> bool:
    """Return whether the arm may hold a clip applier."""
    return any(one.tool.clip is not None for one in params.variants)
