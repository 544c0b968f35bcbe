"""The ports of a teleoperation: a hand and its buttons, the arm, and what the hand is to feel."""

from __future__ import annotations

from controllers.teleoperation.params import TeleoperationParams
from schemas.ports import Port

__all__ = ["NO_GRIPPER", "teleoperation_ports"]

NO_GRIPPER = -1.0
"""Of `gripper`, while nothing is connected: the button leads the jaw."""

_CAMERA = "ECM"
"""Name of the camera's frame, as the dVRK and the motion controller have it."""
_POSE, _TWIST, _WRENCH = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/WrenchStamped",
)
_JOINT_STATE, _NUMBER, _STRING = "sensor_msgs/msg/JointState", "std_msgs/msg/Float64", "std_msgs/msg/String"


def teleoperation_ports(params: TeleoperationParams) -> tuple[Port, ...]:
    """Return the ports of a hand that leads an arm as `params` say."""
    return (*_hand(params), *_arm(params), *_jaw(params), *_streams(params), *_told(params))


def _hand(p: TeleoperationParams) -> tuple[Port, ...]:
    clutch = "leads the arm while it is held" if p.engage == "held" else "clutch"
    still = (0.0,) * 6 if p.law == "pose" else None
    return (
        Port(
            name="master", causality="input", type=_POSE, max_age_ns=p.max_age, description="pose of the hand"
        ),
        Port(
            name="master_twist",
            causality="input",
            type=_TWIST,
            max_age_ns=p.max_age,
            start=still,
            description="of the hand, for `law: velocity`",
        ),
        Port(
            name="buttons",
            causality="input",
            type="sensor_msgs/msg/Joy",
            variability="event",
            description=f"button {p.buttons.clutch}: {clutch}; button {p.buttons.jaw}: closes the jaw",
        ),
        Port(
            name="gripper",
            causality="input",
            type=_NUMBER,
            start=(NO_GRIPPER,),
            description="of the hand, 0 closed .. 1 open; negative: none, the button leads the jaw",
        ),
        Port(
            name="scale",
            causality="input",
            type=_NUMBER,
            start=(p.scale,),
            description="metres of the tip per metre of the hand, over 0 to 1",
        ),
        *(
            Port(
                name=f"lock_{what}",
                causality="input",
                type="std_msgs/msg/Bool",
                variability="event",
                description=f"whether the tip keeps its {kept}",
            )
            for what, kept in (("rotation", "orientation"), ("translation", "position"))
            if p.law == "pose"
        ),
    )


def _arm(p: TeleoperationParams) -> tuple[Port, ...]:
    base, names = f"{p.arm}_base", tuple(joint.name for joint in p.chain.joints)
    at_rest = p.start + (0.0,) * (2 * len(names))
    fields = ("position", "velocity", "effort")
    seen = p.view != "base"
    meaning = (
        "where the command starts: at the first step, whenever the arm gets ready and, of an arm that tells"
        " its operating state, whenever the hand takes over; of a motion controller its setpoint_js"
    )
    return (
        Port(
            name="measured_js",
            causality="input",
            type=_JOINT_STATE,
            names=names,
            fields=fields,
            start=at_rest,
            description=meaning,
        ),
        Port(
            name="operating_state",
            causality="input",
            type="crtk_msgs/msg/OperatingState",
            variability="event",
            description=(
                "of the arm: it follows while ENABLED and homed; an arm that tells it may have other masters"
                " while it does not follow"
            ),
        ),
        Port(
            name="base_in_view",
            causality="input",
            type=_POSE,
            frame=_CAMERA if seen else "",
            start=None if seen else (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            description=(
                "of the arm's base frame in the camera's, unless `view: base`: the motion controller's"
                " SUJ/<arm>/measured_cp"
            ),
        ),
        Port(
            name="tip_wrench",
            causality="input",
            type=_WRENCH,
            frame=base,
            start=(0.0,) * 6,
            description="of tissue on the instrument, at the tip",
        ),
        Port(
            name="rigid_wrench",
            causality="input",
            type=_WRENCH,
            frame=base,
            start=(0.0,) * 6,
            description="of rigid things on the instrument, at the tip",
        ),
        Port(
            name="servo_jp",
            causality="output",
            type=_JOINT_STATE,
            names=names,
            description="command to the arm's joint servos",
        ),
        Port(
            name="goal_cp",
            causality="output",
            type=_POSE,
            frame=base,
            description="where the tip is told to be",
        ),
    )


def _jaw(p: TeleoperationParams) -> tuple[Port, ...]:
    names = tuple(joint.name for joint in p.tool.jaw_joints)
    if not names:
        return ()
    fields = ("position", "velocity", "effort")
    at_rest = (p.jaw, *(0.0,) * (3 * len(names) - 1))
    meaning = "where the jaw starts, as measured_js"
    return (
        Port(
            name="jaw/measured_js",
            causality="input",
            type=_JOINT_STATE,
            names=names,
            fields=fields,
            start=at_rest,
            description=meaning,
        ),
        Port(
            name="jaw/servo_jp",
            causality="output",
            type=_JOINT_STATE,
            names=names,
            description="command to the jaw; what rolls a needle in it stays",
        ),
    )


def _streams(p: TeleoperationParams) -> tuple[Port, ...]:
    names = [f"{p.arm}/servo_jp", *([f"{p.arm}/jaw/servo_jp"] if p.tool.jaw_joints else [])]
    meaning = (
        "the command to the arm's motion controller, at every step while it follows; else nothing, so that"
        " others may move the arm"
    )
    return tuple(
        Port(name=name, causality="output", type=_JOINT_STATE, variability="event", description=meaning)
        for name in names
    )


def _told(p: TeleoperationParams) -> tuple[Port, ...]:
    contact, phases = (
        "for the hand, in the master's base frame",
        "DISABLED, CLUTCHED, ALIGNING or ENABLED: whenever it changes",
    )
    return (
        Port(
            name="contact",
            causality="output",
            type="trocar_msgs/msg/ContactModel",
            period_ns=p.contact_period,
            description=contact,
        ),
        Port(
            name="following",
            causality="output",
            type="std_msgs/msg/Bool",
            description="whether the arm follows the hand",
        ),
        Port(name="state", causality="output", type=_STRING, variability="event", description=phases),
        Port(
            name="warning",
            causality="output",
            type=_STRING,
            variability="event",
            description="why the arm holds, and what to do",
        ),
    )
