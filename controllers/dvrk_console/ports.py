"""The ports of the dVRK's console, named as its topics, and its event outputs.

Beside the topics there are `pedals/`, from a device, and `teleop/`, to and from the teleoperations of arms.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import pi
from typing import Any

from controllers.dvrk_console.params import DvrkConsoleParams
from controllers.ports import NO_POSE, measured_joints
from hub.participant import event_in, event_out, signal_in, signal_out
from robots.dvrk import crtk
from robots.dvrk.console_topics import BUTTON, CONSOLE, PEDALS, SYSTEM, TELEOPERATION
from schemas.crtk import OperatingState, StringStamped
from schemas.message import Message
from schemas.ports import Port
from schemas.ros import BoolMessage, Float64Message, PoseStamped, StringMessage

__all__ = ["NO_GRIPPER", "EventOutputs", "console_ports"]

NO_GRIPPER = -pi
"""rad; angle of a gripper not connected: no master's gripper opens that far the wrong way."""

_SYSTEM_COMMANDS = ("power_on", "power_off", "home", "set_volume")
"""A hub has no loudspeaker: the remaining commands of a dVRK's system are sounds."""
_POWER = "of the generator, while the pedal is pressed and an operator is present"
_MASTER_COMMANDS = {
    name: (crtk.COMMANDS | crtk.MTM_COMMANDS)[name]
    for name in (
        "state_command",
        "hold",
        "move_cp",
        "lock_orientation",
        "unlock_orientation",
        "body/servo_cf",
        "use_gravity_compensation",
    )
}


class EventOutputs:
    """The event outputs of the present step, by port."""

    def __init__(self, ports: Iterable[Port]) -> None:
        self.outputs: dict[str, Any] = {
            port.name: () for port in ports if port.causality == "output" and port.variability == "event"
        }
        self._published: set[str] = set()

    def begin(self) -> None:
        """Clear the events of the last step."""
        for port in self._published:
            self.outputs[port] = ()
        self._published.clear()

    def publish(self, port: str, message: Message) -> None:
        """Publish `message` on `port`."""
        self.outputs[port] += (message,)
        self._published.add(port)


def console_ports(params: DvrkConsoleParams) -> tuple[Port, ...]:
    """Return the ports of a console with these parameters."""
    masters, led = (sorted({name.split("_")[i] for name in params.teleoperations}) for i in (0, 1))
    commands = (
        _prefixed("console", CONSOLE.commands)
        | {f"system/{name}": SYSTEM.commands[name] for name in _SYSTEM_COMMANDS}
        | _prefixed("pedals", PEDALS.events)
    )
    events = (
        _prefixed("console", CONSOLE.events)
        | _prefixed("system", SYSTEM.events)
        | _prefixed("footpedals", PEDALS.events)
    )
    return (
        *_events_in(commands),
        *(event_in(f"{arm}/operating_state", OperatingState) for arm in params.arms),
        *_events_out(events),
        *(signal_out(f"{arm}/energy", description=_POWER, unit="W") for arm in params.energy),
        *(event_out(f"{arm}/state_command", StringStamped) for arm in params.arms),
        event_out("teleop/ECM/buttons", BUTTON, "button 0: the camera pedal leads the endoscope"),
        *(port for master in masters for port in _master(master)),
        *(
            _pose(f"{arm}/setpoint_cp", "of the tip, in the camera's frame: masters are turned like it")
            for arm in led
        ),
        *(port for name in params.teleoperations for port in _teleoperation_ports(name, params)),
    )


def _events_in(types: Mapping[str, str]) -> Iterator[Port]:
    return (event_in(name, type_) for name, type_ in types.items())


def _events_out(types: Mapping[str, str]) -> Iterator[Port]:
    return (event_out(name, type_) for name, type_ in types.items())


def _pose(name: str, meaning: str) -> Port:
    return signal_in(name, PoseStamped, meaning, start=NO_POSE)


def _prefixed(prefix: str, types: Mapping[str, str]) -> dict[str, str]:
    return {f"{prefix}/{name}": type_ for name, type_ in types.items()}


def _master(master: str) -> Iterable[Port]:
    return (
        event_in(f"{master}/operating_state", OperatingState),
        _pose(f"{master}/measured_cp", "of the master, in the display's frame"),
        measured_joints(
            f"{master}/gripper/measured_js",
            ("gripper",),
            "opening of the gripper, as the motors' encoders measure it",
            start=(NO_GRIPPER,),
        ),
        *_events_out(_prefixed(master, _MASTER_COMMANDS)),
    )


def _teleoperation_ports(name: str, params: DvrkConsoleParams) -> Iterable[Port]:
    leads, gripper = f"teleop/{name}", "to the `teleoperation`: 0 closed .. 1 open, negative: none"
    return (
        *_events_in(_prefixed(name, TELEOPERATION.commands)),
        *(event_in(f"{leads}/{said}", StringMessage) for said in ("state", "warning")),
        *_events_out(_prefixed(name, TELEOPERATION.events)),
        event_out(f"{leads}/buttons", BUTTON),
        *(event_out(f"{leads}/lock_{motion}", BoolMessage) for motion in ("rotation", "translation")),
        signal_out(f"{leads}/scale", Float64Message, "to the `teleoperation`", start=(params.scale,)),
        signal_out(f"{leads}/gripper", Float64Message, gripper),
    )
