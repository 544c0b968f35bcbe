"""The ports of an arm: CRTK's towards clients, `drive/...` and `sense/...` towards the robot.

Names and types come from `robots.dvrk.crtk`, for a gateway to ROS to map one to one; here stands the meaning
of each for this controller.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from controllers.motion.params import AnyParams
from controllers.ports import measured_joints
from hub.participant import event_in, event_out, signal_out
from robots.dvrk import crtk
from robots.dvrk.setup_joints import CartArm, joint_names
from schemas.ports import Port
from schemas.ros import Float64Message, JointState, PoseStamped

__all__ = [
    "EQUIPMENT_COMMANDS",
    "MASTER_COMMANDS",
    "arm_ports",
    "event_names",
    "setup_joint_event_names",
    "setup_joint_ports",
]

_STATE_COMMAND = "enable, disable, home, unhome, pause or resume"
_COMMANDS = {
    "state_command": _STATE_COMMAND,
    "use_gravity_compensation": (
        "whether the drives carry the weight that the controller knows, the endoscope's or a master's; on at"
        " time 0"
    ),
    "trajectory_j/set_ratio": (
        "share of the limits of velocity and acceleration that the next moves use, above 0 and up to 1"
    ),
    "trajectory_j/set_ratio_v": "that share of the velocity alone",
    "trajectory_j/set_ratio_a": "that share of the acceleration alone",
    "body/set_cf_orientation_absolute": (
        "whether body wrenches are along the axes of the frame of measured_cp instead of the tip's; off at"
        " time 0"
    ),
    "set_base_frame": (
        "pose of the arm's base in the frame of measured_cp; only with `reference: world` and without setup"
        " joints"
    ),
    "hold": "brake and stay",
    "free": "apply no effort but gravity compensation",
    "servo_jp": "follow these positions, with these velocities where they are given",
    "servo_jr": "follow positions relative to the newest goal, or to the setpoint if nothing is followed",
    "servo_cp": "follow this pose of the tip",
    "servo_cr": (
        "follow a pose displaced and rotated along the axes of the frame that it names, relative to the"
        " newest goal, or to the setpoint"
    ),
    "servo_cs": (
        "follow pose and twist of the tip, keep a twist while it is sent, or apply a wrench: whichever is"
        " marked valid"
    ),
    "servo_ci": "hold the tip by springs and dampers, in the frame of measured_cp",
    "servo_jf": "apply these efforts, gravity compensated",
    "body/servo_cf": "apply this wrench at the tip, in the tip's frame",
    "spatial/servo_cf": "apply this wrench at the base frame's origin, in the arm's base frame",
    "move_jp": "move to these positions",
    "move_jr": "move to positions relative to the goal of the present move, or to the setpoint",
    "move_cp": "move to this pose of the tip, in joint space",
}
_GRIPPER_COMMANDS = {
    "servo_jp": "follow this angle of the jaw, these closings of the fingers",
    "servo_jf": "apply this effort",
    "move_jp": "move to this angle of the jaw, these closings of the fingers",
}
_OPERATING_STATE = (
    "whenever it changes, with each state command that is executed, and with each move, executed or refused"
)
_EVENTS = {
    "operating_state": _OPERATING_STATE,
    "desired_state": (
        "the state that was commanded: DISABLED, ENABLED, HOMED, PAUSED, or FAULT; at time 0, and with each"
        " state command"
    ),
    "goal_reached": "a move has arrived, or was abandoned",
    "error": "a command that cannot be executed, or a fault: what, why, what is allowed",
    "warning": "a command that is refused at present",
    "status": "what happens",
}
_EQUIPMENT = "what the arm holds, in the dVRK's words, at time 0 and after an exchange"
EQUIPMENT_COMMANDS = {
    "tool_type": {
        "set_tool_type": "what the arm holds, or else gets in exchange if it is a spare instrument",
        "emulate_adapter_present": "refused unless true: the adapter is there",
        "emulate_tool_present": "refused unless true: the instrument is there",
    },
    "endoscope_type": {"set_endoscope_type": "refused unless it is what the arm holds"},
}
"""Meanings of commands about an arm's equipment, by the event of publication."""
_MASTER_COMMANDS = {
    "lock_orientation": "hold this orientation while a wrench is applied, in the frame of measured_cp",
    "unlock_orientation": "hold no orientation any more",
}
_MASTER_EVENTS = {
    "gripper/closed": "the gripper has been closed, or open, for 0.2 s",
    "gripper/pinch": "the gripper has been closed for 0.2 s",
    "orientation_locked": "whether the orientation is locked",
}
MASTER_COMMANDS = frozenset(_MASTER_COMMANDS)
"""Commands to masters alone."""
_SETUP_JOINT_COMMANDS = {
    "state_command": _STATE_COMMAND,
    "servo_jp": "refused: the joints are braked",
    "move_jp": "refused: the joints are braked",
}
_SETUP_JOINT_EVENTS = {
    "operating_state": _OPERATING_STATE,
    "warning": "a command that is refused",
    "status": "what happens",
}
_TYPES = (
    crtk.COMMANDS
    | crtk.EVENTS
    | crtk.PSM_COMMANDS
    | crtk.PSM_EVENTS
    | crtk.ECM_COMMANDS
    | crtk.ECM_EVENTS
    | crtk.MTM_COMMANDS
    | crtk.MTM_EVENTS
)


def _own_topics(params: AnyParams) -> tuple[Mapping[str, str], Mapping[str, str]]:
    """Return the meanings of commands and events of this kind of arm alone."""
    if params.equipment is None:
        return _MASTER_COMMANDS, _MASTER_EVENTS
    held = params.equipment[0]
    return EQUIPMENT_COMMANDS[held], {held: _EQUIPMENT}


def event_names(params: AnyParams) -> tuple[str, ...]:
    """Return the names of an arm's event outputs, without the arm's."""
    return (*_EVENTS, *_own_topics(params)[1])


def setup_joint_event_names() -> tuple[str, ...]:
    """Return the names of the event outputs of setup joints, without `SUJ/<arm>/`."""
    return tuple(_SETUP_JOINT_EVENTS)


def arm_ports(arm: str, params: AnyParams, reference: str, period_ns: int) -> Iterator[Port]:
    """Yield all ports of an arm.

    Args:
        arm: name of the arm, such as `PSM1`.
        params: parameters of the arm.
        reference: `frame_id` of Cartesian states other than `local/`.
        period_ns: period of the states, ns.
    """
    joints = tuple(joint.name for joint in params.chain.joints)
    gripper, (commands, events) = params.gripper, _own_topics(params)
    yield from _events(event_in, arm, {**_COMMANDS, **commands})
    if gripper is not None:
        yield from _events(event_in, f"{arm}/{gripper.name}", _GRIPPER_COMMANDS)
    yield from _events(event_out, arm, {**_EVENTS, **events})
    yield from _joint_states(arm, joints, period_ns)
    yield from _cartesian_states(arm, reference, period_ns)
    yield from _wrench_states(arm, len(joints), reference, period_ns)
    if params.equipment is None:
        yield from _master_gripper(arm, period_ns)
    else:
        base = "of the arm's base frame: where the setup joints hold it"
        yield signal_out(f"SUJ/{arm}/measured_cp", PoseStamped, base, frame=reference, period_ns=period_ns)
    yield from _settings(arm, joints, period_ns)
    yield from _servo_command_ports(arm, joints)
    yield signal_out(
        f"drive/{arm}/control_mode",
        description=(
            "of arm and gripper: 0 off, 1 position, 2 effort; 3 and 4: position and effort without gravity"
            " compensation; 5 and 6: effort, and position of a master's wrist, with and without it"
        ),
        size=2,
    )
    if len(params.variants) > 1:
        held = "in the arm: 0 the mounted instrument, 1 the first spare"
        yield signal_out(f"drive/{arm}/instrument", Float64Message, held)
        yield signal_out(f"{arm}/instrument", Float64Message, f"{held}; -1 during an exchange")
    if gripper is not None:
        driven = tuple(joint.name for joint in gripper.joints)
        yield from _joint_states(f"{arm}/{gripper.name}", driven, period_ns)
        yield from _servo_command_ports(f"{arm}/{gripper.name}", driven)


def setup_joint_ports(arm: CartArm, cart: str, period_ns: int) -> Iterator[Port]:
    """Yield the ports of the setup joints under `arm` on the cart with the frame `cart`."""
    prefix = f"SUJ/{arm}"
    yield from _events(event_in, prefix, _SETUP_JOINT_COMMANDS)
    yield from _events(event_out, prefix, _SETUP_JOINT_EVENTS)
    yield signal_out(f"{prefix}/measured_js", JointState, names=joint_names(arm), period_ns=period_ns)
    yield signal_out(
        f"{prefix}/local/measured_cp", PoseStamped, "of the arm's base frame", frame=cart, period_ns=period_ns
    )


def _events(
    declare: Callable[[str, str, str], Port], prefix: str, meanings: Mapping[str, str]
) -> Iterator[Port]:
    for name, meaning in meanings.items():
        yield declare(f"{prefix}/{name}", _TYPES[name], meaning)


def _joint_states(prefix: str, names: tuple[str, ...], period_ns: int) -> Iterator[Port]:
    for name in ("measured_js", "setpoint_js"):
        yield signal_out(
            f"{prefix}/{name}", JointState, names=names, fields=crtk.MEASURED, period_ns=period_ns
        )


def _cartesian_states(arm: str, reference: str, period_ns: int) -> Iterator[Port]:
    for prefix in ("", "local/"):
        for name, type_ in crtk.CARTESIAN_STATES.items():
            meaning = "of the tip" if name.endswith("_cp") else "of the tip's origin"
            frame = crtk.frame_of(arm, prefix + name, reference)
            yield signal_out(f"{arm}/{prefix}{name}", type_, meaning, frame=frame, period_ns=period_ns)


def _wrench_states(arm: str, joints: int, reference: str, period_ns: int) -> Iterator[Port]:
    size, shape = 6 * joints, (6, joints)
    frames = {"body": crtk.tip_frame(arm), "spatial": crtk.base_frame(arm)}
    for name, type_ in crtk.WRENCH_STATES.items():
        kind = name.partition("/")[0]
        seen = crtk.frame_of(arm, name, reference)
        meaning = "that balances the joint efforts"
        if not seen:
            meaning += f"; in {frames[kind]}, or in {reference} with set_cf_orientation_absolute"
        yield signal_out(f"{arm}/{name}", type_, meaning, frame=seen, period_ns=period_ns)
        meaning = f"twist of the tip in {frames[kind]}, linear part first, from joint velocities"
        if kind == "spatial":
            meaning += ", of the point at its origin"
        jacobian = f"{arm}/{kind}/jacobian"
        yield signal_out(jacobian, description=meaning, size=size, shape=shape, period_ns=period_ns)


def _master_gripper(arm: str, period_ns: int) -> Iterator[Port]:
    names = ("gripper",)
    yield measured_joints(f"sense/{arm}/gripper/measured_js", names)
    yield signal_out(
        f"{arm}/gripper/measured_js", JointState, names=names, fields=crtk.MEASURED, period_ns=period_ns
    )


def _settings(arm: str, joints: tuple[str, ...], period_ns: int) -> Iterator[Port]:
    weight = "that carries the weight that the controller knows; 0 while it is switched off"
    ratios = (
        ("ratio", "of velocity and acceleration; 0 where they differ"),
        ("ratio_v", "of the velocity"),
        ("ratio_a", "of the acceleration"),
    )
    for name, meaning in ratios:
        yield signal_out(f"{arm}/trajectory_j/{name}", Float64Message, meaning, period_ns=period_ns)
    yield signal_out(
        f"{arm}/gravity_compensation/setpoint_js",
        JointState,
        weight,
        names=joints,
        fields=("effort",),
        period_ns=period_ns,
    )


def _servo_command_ports(prefix: str, names: tuple[str, ...]) -> Iterator[Port]:
    yield measured_joints(f"sense/{prefix}/measured_js", names)
    yield signal_out(f"drive/{prefix}/servo_jp", JointState, names=names)
    yield signal_out(f"drive/{prefix}/servo_jf", JointState, names=names, fields=("effort",))
