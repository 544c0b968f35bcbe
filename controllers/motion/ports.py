"""The ports of one arm: CRTK's names and types towards the world, `drive/...` and `sense/...` towards the robot.

Names and types as the dVRK 2.x has them (jhu-dvrk/sawIntuitiveResearchKit, jhu-cisst/cisst-ros), so that a ROS face maps them one to one.
"""

from __future__ import annotations

from collections.abc import Iterator

from controllers.motion.params import EcmParams, PsmParams
from schemas.ports import Port

__all__ = ["COMMANDS", "EVENTS", "GRIPPER_COMMANDS", "arm_ports"]

_JOINT_STATE, _POSE, _TWIST, _WRENCH = (
    "sensor_msgs/msg/JointState",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/WrenchStamped",
)
_EMPTY, _STRING, _BOOL = "std_msgs/msg/Empty", "std_msgs/msg/String", "std_msgs/msg/Bool"

COMMANDS = {
    "state_command": ("crtk_msgs/msg/StringStamped", "enable, disable, home, unhome, pause or resume"),
    "use_gravity_compensation": (_BOOL, "whether the drives bear the weight that the controller knows, the endoscope's; on at time 0"),
    "trajectory_j/set_ratio": ("std_msgs/msg/Float64", "share of the limits that moves from now on use, over 0 to 1"),
    "hold": (_EMPTY, "brake, and stay"),
    "free": (_EMPTY, "let go: no effort but gravity compensation"),
    "servo_jp": (_JOINT_STATE, "follow these positions"),
    "servo_jr": (_JOINT_STATE, "follow positions relative to the newest goal, or the setpoint if nothing is followed"),
    "servo_cp": (_POSE, "follow this pose of the tip"),
    "servo_jf": (_JOINT_STATE, "apply these efforts, gravity compensated"),
    "body/servo_cf": (_WRENCH, "apply this wrench at the tip, in the tip's frame"),
    "spatial/servo_cf": (_WRENCH, "apply this wrench at the base frame's origin, in the arm's base frame"),
    "move_jp": (_JOINT_STATE, "go to these positions"),
    "move_jr": (_JOINT_STATE, "go to positions relative to the goal of the move under way, or to the setpoint"),
    "move_cp": (_POSE, "go to this pose of the tip, in joint space"),
}
"""Command ports of every arm: type and meaning. Of commands that come in the same step they are heeded in this order."""

GRIPPER_COMMANDS = {
    "servo_jp": (_JOINT_STATE, "follow this angle of the jaw, these closings of the fingers"),
    "servo_jf": (_JOINT_STATE, "apply this effort"),
    "move_jp": (_JOINT_STATE, "go to this angle of the jaw, these closings of the fingers"),
}
"""Command ports under `jaw/` or `hand/` of an arm with an instrument that grasps: type and meaning."""

EVENTS = {
    "operating_state": ("crtk_msgs/msg/OperatingState", "whenever it changes, and with each command that is heeded"),
    "goal_reached": (_BOOL, "a move has arrived, or was given up"),
    "error": (_STRING, "an order that cannot be carried out, or a fault: what, why, what is allowed"),
    "warning": (_STRING, "an order that comes at the wrong time"),
    "status": (_STRING, "what happens"),
}
"""Event ports of every arm: type and meaning."""


def arm_ports(arm: str, params: PsmParams | EcmParams, reference: str, period_ns: int) -> Iterator[Port]:
    """Yield all ports of `arm`; states come every `period_ns`, Cartesian ones in the frame `reference` unless they are `local/`."""
    joints = params.chain.joints
    names = tuple(joint.name for joint in joints)
    gripper = params.gripper
    grasping = {} if gripper is None else {f"{gripper.name}/{name}": row for name, row in GRIPPER_COMMANDS.items()}
    for name, (type_, meaning) in (COMMANDS | grasping).items():
        yield Port(name=f"{arm}/{name}", causality="input", type=type_, variability="event", description=meaning)
    for name, (type_, meaning) in EVENTS.items():
        yield Port(name=f"{arm}/{name}", causality="output", type=type_, variability="event", description=meaning)
    yield from _states(arm, names, reference, period_ns)
    yield from _robot(arm, names)
    if gripper is not None:
        driven = tuple(joint.name for joint in gripper.joints)
        yield from _joint_states(f"{arm}/{gripper.name}", driven, period_ns)
        yield from _servo(f"{arm}/{gripper.name}", driven)


def _joint_states(prefix: str, names: tuple[str, ...], period_ns: int) -> Iterator[Port]:
    for name in ("measured_js", "setpoint_js"):
        fields = ("position", "velocity", "effort")
        yield Port(name=f"{prefix}/{name}", causality="output", type=_JOINT_STATE, names=names, fields=fields, period_ns=period_ns)


def _states(arm: str, names: tuple[str, ...], reference: str, period_ns: int) -> Iterator[Port]:
    yield from _joint_states(arm, names, period_ns)
    for kind in ("measured", "setpoint"):
        for prefix, frame in (("", reference), ("local/", f"{arm}_base")):
            yield Port(name=f"{arm}/{prefix}{kind}_cp", causality="output", type=_POSE, frame=frame, period_ns=period_ns, description="of the tip")
            yield Port(name=f"{arm}/{prefix}{kind}_cv", causality="output", type=_TWIST, frame=frame, period_ns=period_ns, description="of the tip's origin")
    for kind, frame in (("body", f"{arm}_tip"), ("spatial", f"{arm}_base")):
        meaning = "that balances the joint efforts"
        yield Port(name=f"{arm}/{kind}/measured_cf", causality="output", type=_WRENCH, frame=frame, period_ns=period_ns, description=meaning)
        shape = (6, len(names))
        meaning = f"twist of the tip in {frame}, linear part first, from joint velocities" + (", of the point at its origin" if kind == "spatial" else "")
        yield Port(name=f"{arm}/{kind}/jacobian", causality="output", size=6 * len(names), shape=shape, period_ns=period_ns, description=meaning)
    meaning = "of the arm's base frame: where the setup joints hold it"
    yield Port(name=f"SUJ/{arm}/measured_cp", causality="output", type=_POSE, frame=reference, period_ns=period_ns, description=meaning)
    yield Port(name=f"{arm}/trajectory_j/ratio", causality="output", type="std_msgs/msg/Float64", period_ns=period_ns)


def _robot(arm: str, names: tuple[str, ...]) -> Iterator[Port]:
    yield from _servo(arm, names)
    meaning = "of arm and gripper: 0 off, 1 position, 2 effort; 3 and 4 the last two without gravity compensation"
    yield Port(name=f"drive/{arm}/control_mode", causality="output", size=2, description=meaning)


def _servo(prefix: str, names: tuple[str, ...]) -> Iterator[Port]:
    fields = ("position", "velocity", "effort")
    yield Port(name=f"sense/{prefix}/measured_js", causality="input", type=_JOINT_STATE, names=names, fields=fields)
    yield Port(name=f"drive/{prefix}/servo_jp", causality="output", type=_JOINT_STATE, names=names)
    yield Port(name=f"drive/{prefix}/servo_jf", causality="output", type=_JOINT_STATE, names=names, fields=("effort",))
