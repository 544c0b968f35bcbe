"""The ports of one arm: CRTK's names and types towards the world, `drive/...` and `sense/...` towards the
robot.

Names and types as the dVRK 2.x has them (jhu-dvrk/sawIntuitiveResearchKit, jhu-cisst/cisst-ros), so that a
ROS face maps them one to one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from controllers.motion.params import EcmParams, PsmParams
from robots.dvrk.setup_joints import CartArm
from schemas.ports import Port

__all__ = [
    "CARTESIAN_COMMANDS",
    "COMMANDS",
    "EQUIPMENT_COMMANDS",
    "EVENTS",
    "GRIPPER_COMMANDS",
    "SETUP_JOINT_COMMANDS",
    "SETUP_JOINT_EVENTS",
    "arm_ports",
    "setup_joint_ports",
]

_JOINT_STATE, _POSE, _TWIST, _WRENCH = (
    "sensor_msgs/msg/JointState",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/WrenchStamped",
)
_EMPTY, _STRING, _BOOL, _FLOAT = (
    "std_msgs/msg/Empty",
    "std_msgs/msg/String",
    "std_msgs/msg/Bool",
    "std_msgs/msg/Float64",
)
_STATE_COMMAND = ("crtk_msgs/msg/StringStamped", "enable, disable, home, unhome, pause or resume")
_OPERATING_STATE = (
    "crtk_msgs/msg/OperatingState",
    "whenever it changes, with each state command that is heeded, and with each move, heeded or not",
)

COMMANDS = {
    "state_command": _STATE_COMMAND,
    "use_gravity_compensation": (
        _BOOL,
        "whether the drives bear the weight that the controller knows, the endoscope's; on at time 0",
    ),
    "trajectory_j/set_ratio": (
        _FLOAT,
        "share of the limits of velocity and acceleration that moves from now on use, over 0 to 1",
    ),
    "trajectory_j/set_ratio_v": (_FLOAT, "that share of the velocity alone"),
    "trajectory_j/set_ratio_a": (_FLOAT, "that share of the acceleration alone"),
    "body/set_cf_orientation_absolute": (
        _BOOL,
        (
            "whether body wrenches are along the axes of the frame of measured_cp instead of the tip's; off"
            " at time 0"
        ),
    ),
    "set_base_frame": (
        _POSE,
        (
            "where the arm's base is to be taken to stand, in the frame of measured_cp, with `reference:"
            " world` and without setup joints"
        ),
    ),
    "hold": (_EMPTY, "brake, and stay"),
    "free": (_EMPTY, "let go: no effort but gravity compensation"),
    "servo_jp": (_JOINT_STATE, "follow these positions, with these velocities where they are stated"),
    "servo_jr": (
        _JOINT_STATE,
        "follow positions relative to the newest goal, or the setpoint if nothing is followed",
    ),
    "servo_cp": (_POSE, "follow this pose of the tip"),
    "servo_cr": (
        _POSE,
        (
            "follow a pose shifted and turned along the axes of the frame that it names, relative to the"
            " newest goal, or the setpoint"
        ),
    ),
    "servo_cs": (
        "crtk_msgs/msg/CartesianState",
        "follow pose and twist of the tip, keep a twist while it is told, or apply a wrench: what is stated",
    ),
    "servo_ci": (
        "crtk_msgs/msg/CartesianImpedance",
        "hold the tip by springs and dampers, in the frame of measured_cp",
    ),
    "servo_jf": (_JOINT_STATE, "apply these efforts, gravity compensated"),
    "body/servo_cf": (_WRENCH, "apply this wrench at the tip, in the tip's frame"),
    "spatial/servo_cf": (_WRENCH, "apply this wrench at the base frame's origin, in the arm's base frame"),
    "move_jp": (_JOINT_STATE, "go to these positions"),
    "move_jr": (
        _JOINT_STATE,
        "go to positions relative to the goal of the move under way, or to the setpoint",
    ),
    "move_cp": (_POSE, "go to this pose of the tip, in joint space"),
}
"""Command ports of every arm: type and meaning.

Of commands that come in the same step they are heeded in this order.
"""

CARTESIAN_COMMANDS = frozenset(
    {"servo_cp", "servo_cr", "servo_cs", "servo_ci", "body/servo_cf", "spatial/servo_cf", "move_cp"}
)
"""Those that are heeded only past the cannula."""

GRIPPER_COMMANDS = {
    "servo_jp": (_JOINT_STATE, "follow this angle of the jaw, these closings of the fingers"),
    "servo_jf": (_JOINT_STATE, "apply this effort"),
    "move_jp": (_JOINT_STATE, "go to this angle of the jaw, these closings of the fingers"),
}
"""Command ports under `jaw/` or `hand/` of an arm with an instrument that grasps: type and meaning."""

EVENTS = {
    "operating_state": _OPERATING_STATE,
    "desired_state": (
        _STRING,
        (
            "where the arm was told to go: DISABLED, ENABLED, HOMED, PAUSED, or FAULT; at time 0, and with"
            " each state command"
        ),
    ),
    "goal_reached": (_BOOL, "a move has arrived, or was given up"),
    "error": (_STRING, "an order that cannot be carried out, or a fault: what, why, what is allowed"),
    "warning": (_STRING, "an order that comes at the wrong time"),
    "status": (_STRING, "what happens"),
}
"""Event ports of every arm: type and meaning."""

_EQUIPMENT = (_STRING, "what the arm holds, in the dVRK's words, at time 0")

EQUIPMENT_COMMANDS = {
    "tool_type": {
        "set_tool_type": (_STRING, "refused unless it is what the arm holds"),
        "emulate_adapter_present": (_BOOL, "refused unless true: the adapter is there"),
        "emulate_tool_present": (_BOOL, "refused unless true: the instrument is there"),
    },
    "endoscope_type": {"set_endoscope_type": (_STRING, "refused unless it is what the arm holds")},
}
"""Command ports about what an arm holds, by the event that tells it: type and meaning."""

SETUP_JOINT_COMMANDS = {
    "state_command": _STATE_COMMAND,
    "servo_jp": (_JOINT_STATE, "refused: the joints are braked"),
    "move_jp": (_JOINT_STATE, "refused: the joints are braked"),
}
"""Command ports of the setup joints that carry an arm: type and meaning."""

SETUP_JOINT_EVENTS = {
    "operating_state": _OPERATING_STATE,
    "warning": (_STRING, "an order that is refused"),
    "status": (_STRING, "what happens"),
}
"""Their event ports: type and meaning."""


def arm_ports(arm: str, params: PsmParams | EcmParams, reference: str, period_ns: int) -> Iterator[Port]:
    """Yield all ports of `arm`; states come every `period_ns`, Cartesian ones in the frame `reference` unless
    they are `local/`.
    """
    joints = params.chain.joints
    names = tuple(joint.name for joint in joints)
    gripper = params.gripper
    grasping = (
        {} if gripper is None else {f"{gripper.name}/{name}": row for name, row in GRIPPER_COMMANDS.items()}
    )
    held = params.equipment[0]
    yield from _events(arm, COMMANDS | EQUIPMENT_COMMANDS[held] | grasping, EVENTS | {held: _EQUIPMENT})
    yield from _states(arm, names, reference, period_ns)
    yield from _robot(arm, names)
    if gripper is not None:
        driven = tuple(joint.name for joint in gripper.joints)
        yield from _joint_states(f"{arm}/{gripper.name}", driven, period_ns)
        yield from _servo(f"{arm}/{gripper.name}", driven)


def setup_joint_ports(arm: CartArm, names: tuple[str, ...], cart: str, period_ns: int) -> Iterator[Port]:
    """Yield the ports of the setup joints `names` that carry `arm` on the cart, whose frame is `cart`."""
    prefix = f"SUJ/{arm}"
    yield from _events(prefix, SETUP_JOINT_COMMANDS, SETUP_JOINT_EVENTS)
    yield Port(
        name=f"{prefix}/measured_js", causality="output", type=_JOINT_STATE, names=names, period_ns=period_ns
    )
    meaning = "of the arm's base frame"
    yield Port(
        name=f"{prefix}/local/measured_cp",
        causality="output",
        type=_POSE,
        frame=cart,
        period_ns=period_ns,
        description=meaning,
    )


def _events(
    prefix: str, commands: Mapping[str, tuple[str, str]], events: Mapping[str, tuple[str, str]]
) -> Iterator[Port]:
    for name, (type_, meaning) in commands.items():
        yield Port(
            name=f"{prefix}/{name}", causality="input", type=type_, variability="event", description=meaning
        )
    for name, (type_, meaning) in events.items():
        yield Port(
            name=f"{prefix}/{name}", causality="output", type=type_, variability="event", description=meaning
        )


def _joint_states(prefix: str, names: tuple[str, ...], period_ns: int) -> Iterator[Port]:
    for name in ("measured_js", "setpoint_js"):
        fields = ("position", "velocity", "effort")
        yield Port(
            name=f"{prefix}/{name}",
            causality="output",
            type=_JOINT_STATE,
            names=names,
            fields=fields,
            period_ns=period_ns,
        )


def _states(arm: str, names: tuple[str, ...], reference: str, period_ns: int) -> Iterator[Port]:
    yield from _joint_states(arm, names, period_ns)
    for kind in ("measured", "setpoint"):
        for prefix, frame in (("", reference), ("local/", f"{arm}_base")):
            yield Port(
                name=f"{arm}/{prefix}{kind}_cp",
                causality="output",
                type=_POSE,
                frame=frame,
                period_ns=period_ns,
                description="of the tip",
            )
            yield Port(
                name=f"{arm}/{prefix}{kind}_cv",
                causality="output",
                type=_TWIST,
                frame=frame,
                period_ns=period_ns,
                description="of the tip's origin",
            )
    for kind, frame in (("body", f"{arm}_tip"), ("spatial", f"{arm}_base")):
        seen = "" if kind == "body" else frame  # a switch turns it
        meaning = "that balances the joint efforts" + (
            "" if seen else f"; in {frame}, or in {reference} with set_cf_orientation_absolute"
        )
        yield Port(
            name=f"{arm}/{kind}/measured_cf",
            causality="output",
            type=_WRENCH,
            frame=seen,
            period_ns=period_ns,
            description=meaning,
        )
        shape = (6, len(names))
        meaning = f"twist of the tip in {frame}, linear part first, from joint velocities" + (
            ", of the point at its origin" if kind == "spatial" else ""
        )
        yield Port(
            name=f"{arm}/{kind}/jacobian",
            causality="output",
            size=6 * len(names),
            shape=shape,
            period_ns=period_ns,
            description=meaning,
        )
    meaning = "of the arm's base frame: where the setup joints hold it"
    yield Port(
        name=f"SUJ/{arm}/measured_cp",
        causality="output",
        type=_POSE,
        frame=reference,
        period_ns=period_ns,
        description=meaning,
    )
    for name, meaning in (
        ("ratio", "of velocity and acceleration; 0 where they differ"),
        ("ratio_v", "of the velocity"),
        ("ratio_a", "of the acceleration"),
    ):
        yield Port(
            name=f"{arm}/trajectory_j/{name}",
            causality="output",
            type=_FLOAT,
            period_ns=period_ns,
            description=meaning,
        )
    name, meaning = (
        f"{arm}/gravity_compensation/setpoint_js",
        "that bears the weight that the controller knows; 0 while it does not",
    )
    yield Port(
        name=name,
        causality="output",
        type=_JOINT_STATE,
        names=names,
        fields=("effort",),
        period_ns=period_ns,
        description=meaning,
    )


def _robot(arm: str, names: tuple[str, ...]) -> Iterator[Port]:
    yield from _servo(arm, names)
    meaning = (
        "of arm and gripper: 0 off, 1 position, 2 effort; 3 and 4 the last two without gravity compensation"
    )
    yield Port(name=f"drive/{arm}/control_mode", causality="output", size=2, description=meaning)


def _servo(prefix: str, names: tuple[str, ...]) -> Iterator[Port]:
    fields = ("position", "velocity", "effort")
    yield Port(
        name=f"sense/{prefix}/measured_js", causality="input", type=_JOINT_STATE, names=names, fields=fields
    )
    yield Port(name=f"drive/{prefix}/servo_jp", causality="output", type=_JOINT_STATE, names=names)
    yield Port(
        name=f"drive/{prefix}/servo_jf",
        causality="output",
        type=_JOINT_STATE,
        names=names,
        fields=("effort",),
    )
