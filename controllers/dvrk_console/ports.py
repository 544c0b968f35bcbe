"""The ports of the console: named as the topics of a dVRK; `pedals/` from what is pressed, `teleop/` to and
from those who lead.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import pi

from controllers.dvrk_console.params import ConsoleParams
from robots.dvrk.console_topics import BUTTON, CONSOLE, PEDALS, SYSTEM, TELEOPERATION
from schemas.ports import Port

__all__ = ["NO_GRIPPER", "console_ports"]

_JOINT_STATE, _POSE = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PoseStamped"
_STATE_COMMAND, _OPERATING_STATE = "crtk_msgs/msg/StringStamped", "crtk_msgs/msg/OperatingState"
_EMPTY, _STRING, _BOOL, _FLOAT = (f"std_msgs/msg/{name}" for name in ("Empty", "String", "Bool", "Float64"))

NO_GRIPPER = -pi
"""rad; angle of a gripper that is not connected: no master's opens that far the other way."""

_SYSTEM_HEARD = ("power_on", "power_off", "home", "set_volume")
"""A hub has no loudspeaker: what else the system of a dVRK hears are sounds."""
_MASTER_TOLD = {
    "state_command": _STATE_COMMAND,
    "hold": _EMPTY,
    "move_cp": _POSE,
    "lock_orientation": "geometry_msgs/msg/Quaternion",
    "unlock_orientation": _EMPTY,
    "body/servo_cf": "geometry_msgs/msg/WrenchStamped",
    "use_gravity_compensation": _BOOL,
}


def console_ports(params: ConsoleParams) -> tuple[Port, ...]:
    """Return the ports of a console as `params` say."""
    masters, led = (sorted({name.split("_")[i] for name in params.teleoperations}) for i in (0, 1))
    heard = (
        _named("console", CONSOLE.commands)
        | {f"system/{name}": SYSTEM.commands[name] for name in _SYSTEM_HEARD}
        | _named("pedals", PEDALS.events)
    )
    told = (
        _named("console", CONSOLE.events)
        | _named("system", SYSTEM.events)
        | _named("footpedals", PEDALS.events)
    )
    return (
        *_events("input", heard | {f"{arm}/operating_state": _OPERATING_STATE for arm in params.arms}),
        *_events("output", told | {f"{arm}/state_command": _STATE_COMMAND for arm in params.arms}),
        Port(
            name="teleop/ECM/buttons",
            causality="output",
            type=BUTTON,
            variability="event",
            description="button 0: the camera pedal leads the endoscope",
        ),
        *(port for master in masters for port in _master(master)),
        *(
            _pose(f"{arm}/setpoint_cp", "of the tip, in the camera's frame: masters are turned like it")
            for arm in led
        ),
        *(port for name in params.teleoperations for port in _teleoperation(name, params)),
    )


def _events(causality: str, types: Mapping[str, str]) -> Iterator[Port]:
    for name, type_ in types.items():
        yield Port.model_validate(
            {"name": name, "causality": causality, "type": type_, "variability": "event"}
        )


def _pose(name: str, meaning: str) -> Port:
    return Port(
        name=name,
        causality="input",
        type=_POSE,
        start=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
        description=meaning,
    )


def _named(prefix: str, types: Mapping[str, str]) -> dict[str, str]:
    return {f"{prefix}/{name}": type_ for name, type_ in types.items()}


def _master(master: str) -> Iterable[Port]:
    gripper, opening = (
        f"{master}/gripper/measured_js",
        "opening of the gripper, as the motors' encoders tell it",
    )
    fields = ("position", "velocity", "effort")
    return (
        *_events("input", {f"{master}/operating_state": _OPERATING_STATE}),
        _pose(f"{master}/measured_cp", "of the master, in the display's frame"),
        Port(
            name=gripper,
            causality="input",
            type=_JOINT_STATE,
            names=("gripper",),
            fields=fields,
            start=(NO_GRIPPER, 0.0, 0.0),
            description=opening,
        ),
        *_events("output", _named(master, _MASTER_TOLD)),
    )


def _teleoperation(name: str, params: ConsoleParams) -> Iterable[Port]:
    leads, tells = f"teleop/{name}", "to the `teleoperation`"
    return (
        *_events(
            "input",
            _named(name, TELEOPERATION.commands) | {f"{leads}/state": _STRING, f"{leads}/warning": _STRING},
        ),
        *_events("output", _named(name, TELEOPERATION.events)),
        *_events(
            "output",
            {f"{leads}/buttons": BUTTON, f"{leads}/lock_rotation": _BOOL, f"{leads}/lock_translation": _BOOL},
        ),
        Port(
            name=f"{leads}/scale", causality="output", type=_FLOAT, start=(params.scale,), description=tells
        ),
        Port(
            name=f"{leads}/gripper",
            causality="output",
            type=_FLOAT,
            description=f"{tells}: 0 closed .. 1 open, negative: none",
        ),
    )
