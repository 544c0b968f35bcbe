"""The ports of a teleoperation: a hand and its buttons, the arm, and what the hand is to feel."""

from __future__ import annotations

from controllers.teleoperation.params import TeleoperationParams
from robots.dvrk import crtk
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.ros import (
    BoolMessage,
    Float64Message,
    JointState,
    Joy,
    PoseStamped,
    StringMessage,
    TwistStamped,
    WrenchStamped,
)
from schemas.trocar_msgs import ContactModel

__all__ = ["NO_GRIPPER", "teleoperation_ports"]

NO_GRIPPER = -1.0
"""Of `gripper`, while nothing is connected: the button leads the jaw."""


def teleoperation_ports(params: TeleoperationParams) -> tuple[Port, ...]:
    """Return the ports of a hand that leads an arm."""
    return (*_hand(params), *_arm(params), *_jaw(params), *_streams(params), *_published(params))


def _hand(p: TeleoperationParams) -> tuple[Port, ...]:
    clutch = "leads the arm while it is held" if p.engage == "held" else "clutch"
    still = (0.0,) * 6 if p.law == "pose" else None
    return (
        Port(
            name="master",
            causality="input",
            type=PoseStamped.ros_type,
            max_age_ns=p.max_age,
            description="pose of the hand",
        ),
        Port(
            name="master_twist",
            causality="input",
            type=TwistStamped.ros_type,
            max_age_ns=p.max_age,
            start=still,
            description="of the hand, for `law: velocity`",
        ),
        Port(
            name="buttons",
            causality="input",
            type=Joy.ros_type,
            variability="event",
            description=f"button {p.buttons.clutch}: {clutch}; button {p.buttons.jaw}: closes the jaw",
        ),
        Port(
            name="gripper",
            causality="input",
            type=Float64Message.ros_type,
            start=(NO_GRIPPER,),
            description="of the hand, 0 closed .. 1 open; negative: none, the button leads the jaw",
        ),
        Port(
            name="scale",
            causality="input",
            type=Float64Message.ros_type,
            start=(p.scale,),
            description="metres of the tip per metre of the hand, above 0 and up to 1",
        ),
        *(
            Port(
                name=f"lock_{what}",
                causality="input",
                type=BoolMessage.ros_type,
                variability="event",
                description=f"whether the tip keeps its {kept}",
            )
            for what, kept in (("rotation", "orientation"), ("translation", "position"))
            if p.law == "pose"
        ),
    )


def _arm(p: TeleoperationParams) -> tuple[Port, ...]:
    base, names = crtk.base_frame(p.arm), tuple(joint.name for joint in p.chain.joints)
    at_rest = p.start + (0.0,) * (2 * len(names))
    seen = p.view != "base"
    meaning = (
        "where the command starts: at the first step, whenever the arm gets ready and, of an arm that"
        " publishes its operating state, whenever the hand takes over; of a motion controller its setpoint_js"
    )
    return (
        Port(
            name="measured_js",
            causality="input",
            type=JointState.ros_type,
            names=names,
            fields=crtk.MEASURED,
            start=at_rest,
            description=meaning,
        ),
        Port(
            name="operating_state",
            causality="input",
            type=OperatingState.ros_type,
            variability="event",
            description=(
                "of the arm: it follows while ENABLED and homed; an arm that publishes it may be commanded by"
                " others while it does not follow"
            ),
        ),
        Port(
            name="base_in_view",
            causality="input",
            type=PoseStamped.ros_type,
            frame=crtk.CAMERA_FRAME if seen else "",
            start=None if seen else (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            description=(
                "of the arm's base frame in the camera's, unless `view: base`: the motion controller's"
                " SUJ/<arm>/measured_cp"
            ),
        ),
        Port(
            name="tip_wrench",
            causality="input",
            type=WrenchStamped.ros_type,
            frame=base,
            start=(0.0,) * 6,
            description="of tissue on the instrument, at the tip",
        ),
        Port(
            name="rigid_wrench",
            causality="input",
            type=WrenchStamped.ros_type,
            frame=base,
            start=(0.0,) * 6,
            description="of rigid things on the instrument, at the tip",
        ),
        Port(
            name="servo_jp",
            causality="output",
            type=JointState.ros_type,
            names=names,
            description="command to the arm's joint servos",
        ),
        Port(
            name="goal_cp",
            causality="output",
            type=PoseStamped.ros_type,
            frame=base,
            description="where the tip is commanded to be",
        ),
    )


def _jaw(p: TeleoperationParams) -> tuple[Port, ...]:
    names = tuple(joint.name for joint in p.tool.jaw_joints)
    if not names:
        return ()
    at_rest = (p.jaw, *(0.0,) * (3 * len(names) - 1))
    meaning = "where the jaw starts, as measured_js"
    return (
        Port(
            name="jaw/measured_js",
            causality="input",
            type=JointState.ros_type,
            names=names,
            fields=crtk.MEASURED,
            start=at_rest,
            description=meaning,
        ),
        Port(
            name="jaw/servo_jp",
            causality="output",
            type=JointState.ros_type,
            names=names,
            description="command to the jaw; its roller stays where it is",
        ),
    )


def _streams(p: TeleoperationParams) -> tuple[Port, ...]:
    names = [f"{p.arm}/servo_jp", *([f"{p.arm}/jaw/servo_jp"] if p.tool.jaw_joints else [])]
    meaning = (
        "the command to the arm's motion controller, at every step while it follows; otherwise nothing, so"
        " that others may move the arm"
    )
    return tuple(
        Port(
            name=name, causality="output", type=JointState.ros_type, variability="event", description=meaning
        )
        for name in names
    )


def _published(p: TeleoperationParams) -> tuple[Port, ...]:
    contact, phases = (
        "for the hand, in the master's base frame",
        "DISABLED, CLUTCHED, ALIGNING or ENABLED: whenever it changes",
    )
    return (
        Port(
            name="contact",
            causality="output",
            type=ContactModel.ros_type,
            period_ns=p.contact_period,
            description=contact,
        ),
        Port(
            name="following",
            causality="output",
            type=BoolMessage.ros_type,
            description="whether the arm follows the hand",
        ),
        Port(
            name="state",
            causality="output",
            type=StringMessage.ros_type,
            variability="event",
            description=phases,
        ),
        Port(
            name="warning",
            causality="output",
            type=StringMessage.ros_type,
            variability="event",
            description="why the arm holds, and what to do",
        ),
    )
