"""The surgeon's console of a dVRK as a participant: which master leads which arm, and when.

Power, home, enable, select, scale, operator, clutch and camera act as on the real system
(jhu-dvrk/sawIntuitiveResearchKit, console.cpp, system.cpp, and mtsIntuitiveResearchKitConsole.cpp of 2.2,
UpdateTeleopState); docs/decisions/0032 states where the sources leave room.
"""

from __future__ import annotations

from typing import ClassVar, cast

import numpy as np

from controllers.dvrk_console.component import Component, Published, TeleopState
from controllers.dvrk_console.params import DvrkConsoleParams
from controllers.dvrk_console.ports import EventOutputs, console_ports
from controllers.dvrk_console.readiness import Readiness
from hub.participant import Controller, Inputs, Outputs, Params, Record, Setup, choice, flag
from robots.dvrk.console_topics import PEDALS
from robots.limits import TOLERANCE, distinct
from schemas.crtk import StringStamped
from schemas.errors import did_you_mean
from schemas.ports import Port
from schemas.ros import BoolMessage, Float64Message, Joy, StringMessage

__all__ = ["DvrkConsole"]

_BUTTONS = {"operator_present": "operatorpresent", "clutch": "clutch", "camera": "camera"}
"""Published pedals: the name of the output, also a flag of the state, and the name of the pedal."""
_POWER = {"power_on": "enable", "power_off": "disable", "home": "home"}
"""State command for all arms, by topic of `system/...`."""
_TAP = 2
"""Value of `buttons[0]`: pressed and released quickly; does not count as held."""


class DvrkConsoleState(Record):
    """Pedals and teleoperation as a whole."""

    enabled = flag()
    """Whether teleoperation is enabled."""
    operator_present = flag()
    clutch = flag()
    camera = flag()
    leads_camera = choice(Published.NOTHING)
    """Whether the camera pedal leads the endoscope."""
    published = flag()
    """Whether everything was published once."""


class DvrkConsole(Controller):
    """Reads pedals and programs; permits teleoperations to lead, commands arms and masters."""

    params_model: ClassVar[type[Params]] = DvrkConsoleParams
    params: DvrkConsoleParams

    def __init__(self, name: str, params: DvrkConsoleParams) -> None:
        super().__init__(name, params)
        self._events = EventOutputs(self.ports)
        self._components = {name: Component(name, params, self._events) for name in params.teleoperations}
        masters = sorted({component.master for component in self._components.values()})
        self._readiness = Readiness((*params.arms, *masters))
        self._state = DvrkConsoleState()
        self._state.enabled, self._state.operator_present = params.enabled, params.operator_present
        for component in self._components.values():
            component.state.selected = not self._rival_components(component)
        self._powers = {arm: np.zeros(1) for arm in params.energy}
        """Power of every generator, W."""
        self.keep(
            self._state,
            self._readiness.state,
            *(component.state for component in self._components.values()),
            *self._powers.values(),
        )
        self._outputs = self._events.outputs
        for arm, power in self._powers.items():
            self._outputs[f"{arm}/energy"] = power
        for name, component in self._components.items():
            self._outputs |= {
                f"teleop/{name}/scale": component.state.part("scale"),
                f"teleop/{name}/gripper": component.state.part("gripper"),
            }

    @property
    def ports(self) -> tuple[Port, ...]:
        """The topics of `console`, `system`, `footpedals` and of each teleoperation component.

        Beside these topics `pedals/`, and `teleop/` to and from the teleoperations.
        """
        return console_ports(self.params)

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with all pedals released."""
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Read programs and pedals, and permit or stop teleoperations."""
        self._events.begin()
        if not self._state.published:
            self._state.published = True
            self._publish_all()
        self._readiness.receive(inputs)
        if not inputs.quiet:
            self._execute_system_commands(inputs)
            self._execute_commands(inputs)
            self._read_pedals(inputs)
        if not self._state.operator_present:
            for power in self._powers.values():
                power[:] = 0.0
        self._lead_camera()
        for component in self._components.values():
            component.step(
                t + h, inputs, self._requested_state(component), self._readiness, clutched=self._state.clutch
            )
        return self._outputs

    def _publish_all(self) -> None:
        """Publish everything once: the topics are latched."""
        self._events.publish("console/teleop/enabled", BoolMessage(data=self._state.enabled))
        self._events.publish("console/teleop/scale", Float64Message(data=self.params.scale))
        self._events.publish("system/volume", Float64Message(data=0.0))
        self._publish_selected()
        for component in self._components.values():
            component.publish_all()

    def _requested_state(self, component: Component) -> TeleopState:
        """Return the state of a component as requested by the console (UpdateTeleopState)."""
        if not (self._state.enabled and component.state.selected):
            return TeleopState.DISABLED
        if not self._state.operator_present:
            return TeleopState.ALIGNING_MTM
        return TeleopState.DISABLED if self._state.camera else TeleopState.ENABLED

    def _execute_system_commands(self, inputs: Inputs) -> None:
        for name, command in _POWER.items():
            for _ in inputs.events(f"system/{name}"):
                if name == "power_off":
                    self._enable_teleoperation(enabled=False)
                for arm in self.params.arms:
                    self._events.publish(f"{arm}/state_command", StringStamped(string=command))
        for volume in cast("tuple[Float64Message, ...]", inputs.events("system/set_volume")):
            if -TOLERANCE <= volume.data <= 1.0 + TOLERANCE:
                self._events.publish("system/volume", Float64Message(data=min(max(volume.data, 0.0), 1.0)))
            else:
                value = distinct(volume.data, 0.0, 1.0)[0]
                self._warn(f"volume {value} is refused, allowed are 0 to 1")

    def _execute_commands(self, inputs: Inputs) -> None:
        for enable in cast("tuple[BoolMessage, ...]", inputs.events("console/teleop/enable")):
            self._enable_teleoperation(enabled=enable.data)
        for scale in cast("tuple[Float64Message, ...]", inputs.events("console/teleop/set_scale")):
            self._set_scale(scale)
        for name in cast("tuple[StringMessage, ...]", inputs.events("console/teleop/select")):
            self._select_component(name.data, selected=True)
        for name in cast("tuple[StringMessage, ...]", inputs.events("console/teleop/unselect")):
            self._select_component(name.data, selected=False)

    def _read_pedals(self, inputs: Inputs) -> None:
        for pedal in PEDALS.events:
            for joy in cast("tuple[Joy, ...]", inputs.events(f"pedals/{pedal}")):
                self._events.publish(f"footpedals/{pedal}", joy)
                self._set_powers(pedal, joy)
        for button, pedal in _BUTTONS.items():
            for joy in cast(
                "tuple[Joy, ...]",
                (*inputs.events(f"pedals/{pedal}"), *inputs.events(f"console/emulate_{button}")),
            ):
                if not joy.buttons.size:
                    self._warn(
                        f"{button}: a Joy without a button is refused, expected buttons[0]: 0 released, 1"
                        " pressed, 2 a quick tap"
                    )
                    continue
                if joy.buttons[0] != _TAP:
                    setattr(self._state, button, joy.buttons[0] != 0)
                self._events.publish(f"console/{button}", joy)

    def _set_powers(self, pedal: str, joy: Joy) -> None:
        """Let the generators of a pedal give their power while the pedal is held."""
        held = joy.buttons.size > 0 and joy.buttons[0] == 1
        for arm, generator in self.params.energy.items():
            if generator.pedal == pedal:
                self._powers[arm][0] = generator.power if held else 0.0

    def _enable_teleoperation(self, *, enabled: bool) -> None:
        self._state.enabled = enabled
        self._events.publish("console/teleop/enabled", BoolMessage(data=enabled))

    def _set_scale(self, scale: Float64Message) -> None:
        if not 0.0 < scale.data <= 1.0 + TOLERANCE:
            value = distinct(scale.data, 0.0, 1.0)[0]
            self._warn(f"scale {value} is refused, allowed is above 0 and up to 1")
            return
        accepted = min(scale.data, 1.0)
        self._events.publish("console/teleop/scale", Float64Message(data=accepted))
        for component in self._components.values():
            component.set_scale(accepted)

    def _rival_components(self, component: Component) -> list[Component]:
        """Return the selected components with the same master or the same arm."""
        others = (
            other for other in self._components.values() if other is not component and other.state.selected
        )
        return [other for other in others if other.master == component.master or other.arm == component.arm]

    def _select_component(self, name: str, *, selected: bool) -> None:
        """Select a component, instead of another of the same master, or unselect the component.

        An arm led by another master is refused.
        """
        component = self._components.get(name)
        if component is None:
            self._warn(f"there is no teleoperation '{name}'.{did_you_mean(name, self._components)}")
        elif not selected:
            component.state.selected = False
        elif taken := [
            other.name for other in self._rival_components(component) if other.arm == component.arm
        ]:
            self._warn(
                f"'{name}' is not selected: {component.arm} is led in '{taken[0]}', unselect that first"
            )
        else:
            for other in self._rival_components(component):
                other.state.selected = False
            component.state.selected = True
        self._publish_selected()

    def _publish_selected(self) -> None:
        for name, component in self._components.items():
            self._events.publish(
                f"console/teleop/{'selected' if component.state.selected else 'unselected'}",
                StringMessage(data=name),
            )

    def _lead_camera(self) -> None:
        """Permit or stop leading the endoscope; enable and home the endoscope first."""
        state = self._state
        leads = state.enabled and state.operator_present and state.camera
        if leads != state.leads_camera:
            for command in (
                self._readiness.state_commands("ECM") if leads and "ECM" in self.params.arms else ()
            ):
                self._events.publish("ECM/state_command", StringStamped(string=command))
            state.leads_camera = Published(leads)
            self._events.publish("teleop/ECM/buttons", Joy(buttons=np.array([leads], np.int32)))

    def _warn(self, text: str) -> None:
        self._events.publish("console/warning", StringMessage(data=text))
