"""The surgeon's console of a dVRK as a participant: who leads which arm, and when.

Power, home, enable, select, scale, operator, clutch and camera mean what they mean on the real system
(jhu-dvrk/sawIntuitiveResearchKit, console.cpp, system.cpp, and mtsIntuitiveResearchKitConsole.cpp of 2.2,
UpdateTeleopState); docs/decisions/0032 says where the sources leave room.
"""

from __future__ import annotations

from typing import ClassVar, cast

import numpy as np

from controllers.dvrk_console.component import Component, State
from controllers.dvrk_console.params import ConsoleParams
from controllers.dvrk_console.ports import console_ports
from controllers.dvrk_console.readiness import Readiness
from controllers.dvrk_console.voice import Voice
from hub.participant import Inputs, Outputs, Params, Setup, Stepped, restore_arrays, state_hash
from robots.dvrk.console_topics import PEDALS
from schemas.crtk import StringStamped
from schemas.errors import did_you_mean
from schemas.ports import Port
from schemas.ros import BoolMessage, Float64Message, Joy, StringMessage

__all__ = ["Console"]

_BUTTONS = {"operator_present": "operatorpresent", "clutch": "clutch", "camera": "camera"}
"""What the console makes of pedals: its name for it, and the pedal's."""
_POWER = {"power_on": "enable", "power_off": "disable", "home": "home"}
"""What `system/...` orders all arms."""
_TAP = 2
"""Of `buttons[0]`: pressed and released so quickly that nothing was meant to be held."""


class Console(Stepped):
    """Pedals and programs in; who leads, what arms and masters are told, and the console's topics out."""

    params_model: ClassVar[type[Params]] = ConsoleParams
    params: ConsoleParams

    def __init__(self, name: str, params: ConsoleParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._voice = Voice(
            port.name for port in self.ports if port.causality == "output" and port.variability == "event"
        )
        self._components = {name: Component(name, params, self._voice) for name in params.teleoperations}
        masters = sorted({component.master for component in self._components.values()})
        self._readiness = Readiness((*params.arms, *masters))
        self._memory = np.zeros(6)
        self._enabled, self._operator, self._clutch, self._camera, self._leads_camera, self._introduced = (
            np.split(self._memory, 6)
        )
        self._pressed = dict(zip(_BUTTONS, (self._operator, self._clutch, self._camera), strict=True))
        self._enabled[0], self._leads_camera[0] = params.enabled, -1.0
        for component in self._components.values():
            component.selected[0] = not self._rivals(component)
        self._state = (
            self._memory,
            self._readiness.state,
            *(component.state for component in self._components.values()),
        )
        self._outputs = self._voice.outputs
        for name, component in self._components.items():
            self._outputs |= {
                f"teleop/{name}/scale": component.scale,
                f"teleop/{name}/gripper": component.gripper,
            }

    @property
    def ports(self) -> tuple[Port, ...]:
        """The topics of `console`, `system`, `footpedals` and of each teleoperation component; `pedals/` in,
        `teleop/` to those who lead.
        """
        return console_ports(self.params)

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with nobody at the console."""
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Heed programs and pedals; let those lead who are to."""
        self._voice.begin()
        if not self._introduced[0]:
            self._introduced[0] = 1.0
            self._introduce()
        self._readiness.hear(inputs)
        self._heed_system(inputs)
        self._heed_programs(inputs)
        self._heed_pedals(inputs)
        self._lead_camera()
        for component in self._components.values():
            component.step(
                t + h, inputs, self._wish(component), self._readiness, clutched=bool(self._clutch[0])
            )
        return self._outputs

    def _introduce(self) -> None:
        """Say how everything is, for those who come later."""
        self._voice.say("console/teleop/enabled", BoolMessage(data=bool(self._enabled[0])))
        self._voice.say("console/teleop/scale", Float64Message(data=self.params.scale))
        self._voice.say("system/volume", Float64Message(data=0.0))
        self._tell_selected()
        for component in self._components.values():
            component.introduce()

    def _wish(self, component: Component) -> State:
        """Return what the console wants of a component (UpdateTeleopState)."""
        if not (self._enabled[0] and component.selected[0]):
            return State.DISABLED
        if not self._operator[0]:
            return State.ALIGNING_MTM
        return State.DISABLED if self._camera[0] else State.ENABLED

    def _heed_system(self, inputs: Inputs) -> None:
        for name, command in _POWER.items():
            for _ in inputs.events(f"system/{name}"):
                if name == "power_off":
                    self._enable(wish=False)
                for arm in self.params.arms:
                    self._voice.say(f"{arm}/state_command", StringStamped(string=command))
        for volume in cast("tuple[Float64Message, ...]", inputs.events("system/set_volume")):
            if 0.0 <= volume.data <= 1.0:
                self._voice.say("system/volume", volume)
            else:
                self._warn(f"volume {volume.data:g} is refused, allowed are 0 to 1")

    def _heed_programs(self, inputs: Inputs) -> None:
        for wish in cast("tuple[BoolMessage, ...]", inputs.events("console/teleop/enable")):
            self._enable(wish=wish.data)
        for scale in cast("tuple[Float64Message, ...]", inputs.events("console/teleop/set_scale")):
            self._set_scale(scale)
        for name in cast("tuple[StringMessage, ...]", inputs.events("console/teleop/select")):
            self._select(name.data, wish=True)
        for name in cast("tuple[StringMessage, ...]", inputs.events("console/teleop/unselect")):
            self._select(name.data, wish=False)

    def _heed_pedals(self, inputs: Inputs) -> None:
        for pedal in PEDALS.events:
            for joy in inputs.events(f"pedals/{pedal}"):
                self._voice.say(f"footpedals/{pedal}", joy)
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
                    self._pressed[button][0] = joy.buttons[0] != 0
                self._voice.say(f"console/{button}", joy)

    def _enable(self, *, wish: bool) -> None:
        self._enabled[0] = wish
        self._voice.say("console/teleop/enabled", BoolMessage(data=wish))

    def _set_scale(self, scale: Float64Message) -> None:
        if not 0.0 < scale.data <= 1.0:
            self._warn(f"scale {scale.data:g} is refused, allowed are over 0 to 1")
            return
        self._voice.say("console/teleop/scale", scale)
        for component in self._components.values():
            component.set_scale(scale.data)

    def _rivals(self, component: Component) -> list[Component]:
        """Return those that are selected and have the same master or the same arm."""
        others = (
            other for other in self._components.values() if other is not component and other.selected[0]
        )
        return [other for other in others if other.master == component.master or other.arm == component.arm]

    def _select(self, name: str, *, wish: bool) -> None:
        """Select a component, instead of another one of the same master; an arm that another master leads is
        not taken from it.
        """
        component = self._components.get(name)
        if component is None:
            self._warn(f"there is no teleoperation '{name}'.{did_you_mean(name, self._components)}")
        elif not wish:
            component.selected[0] = 0.0
        elif taken := [other.name for other in self._rivals(component) if other.arm == component.arm]:
            self._warn(
                f"'{name}' is not selected: {component.arm} is led in '{taken[0]}', unselect that first"
            )
        else:
            for other in self._rivals(component):
                other.selected[0] = 0.0
            component.selected[0] = 1.0
        self._tell_selected()

    def _tell_selected(self) -> None:
        for name, component in self._components.items():
            self._voice.say(
                f"console/teleop/{'selected' if component.selected[0] else 'unselected'}",
                StringMessage(data=name),
            )

    def _lead_camera(self) -> None:
        """Tell who leads the endoscope whether it may; make the endoscope ready first."""
        leads = self._enabled[0] and self._operator[0] and self._camera[0]
        if leads != self._leads_camera[0]:
            for command in self._readiness.orders("ECM") if leads and "ECM" in self.params.arms else ():
                self._voice.say("ECM/state_command", StringStamped(string=command))
            self._leads_camera[0] = leads
            self._voice.say("teleop/ECM/buttons", Joy(buttons=np.array([leads], np.int32)))

    def _warn(self, text: str) -> None:
        self._voice.say("console/warning", StringMessage(data=text))

    def state_hash(self) -> int:
        """Return the hash of pedals, selection, and how far each component is."""
        return state_hash(*self._state)

    def save(self) -> bytes:
        """Return what is hashed."""
        return b"".join(array.tobytes() for array in self._state)

    def restore(self, state: bytes) -> None:
        """Return to a saved state. Raises StateError if it has the wrong size."""
        restore_arrays(self.name, self._state, state)

    def close(self) -> None:
        """Nothing is held."""
