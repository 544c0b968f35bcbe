"""Kind `touch`: haptic styluses of 3D Systems (Touch, Phantom) through OpenHaptics."""

from __future__ import annotations

import threading
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from devices.diagnosis import Diagnosis
from devices.haptics.contact import ZERO, planes_of
from devices.haptics.limits import TOUCH, DeviceLimits
from devices.haptics.ports import force_sample, stylus_ports
from devices.openhaptics import diagnoses
from devices.openhaptics.exchange import State, model_doubles
from devices.openhaptics.hdapi import find
from devices.openhaptics.params import StylusParams, TouchParams
from devices.openhaptics.process import ServoProcess
from devices.openhaptics.stylus import Phase
from devices.openhaptics.watch import Lost, Watch
from devices.samples import button_sample, pose_sample, twist_sample
from hub.participant import Device, Params, Sample, Value
from robots import rotation
from schemas.errors import MessageError, ScenarioError
from schemas.ports import Port
from schemas.trocar_msgs import ContactModel

__all__ = ["Touch"]

_BUTTONS = 2
"""A Touch has two; HDAPI has room for four."""
_SETTLING = 1.0
"""Time without valid frames that is worth a word, s: the first ones after the start never are."""


class Touch(Device):
    """The styluses of this machine.

    A stylus that is absent, busy, not calibrated or faulty gives no pose, twist or force; its diagnosis says
    what to do, and it comes back by itself.
    """

    params_model: ClassVar[type[Params]] = TouchParams
    params: TouchParams

    def __init__(self, name: str, params: TouchParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._styluses = self._new()
        self._watch: Watch | None = None
        self._writing = threading.Lock()
        self._offset_ns = 0

    @property
    def ports(self) -> tuple[Port, ...]:
        """Of each stylus: `pose`, `twist`, `buttons`, `force` and `diagnostics` out, `contact` in."""
        return tuple(port for stylus in self._styluses.values() for port in stylus.ports)

    def open(self, directory: Path) -> None:
        """Start the servo process.

        Raises DeviceError if there is no library, or it cannot be loaded; a stylus that is not there is
        looked for.
        """
        library = find(None if self.params.library is None else directory / self.params.library)
        self._styluses = self._new()
        self._offset_ns = -(2**63)
        self._watch = Watch(
            library, {name: params.spec(name) for name, params in self.params.styluses.items()}, self._opened
        )
        self._watch.start(perf_counter())

    def read(self, t: int) -> list[Sample]:
        """Return what the styluses did since the last call: every button, the newest pose, twist and force,
        and what changed about them.
        """
        watch = self._watch
        if watch is None:
            return []
        now = perf_counter()
        # Both clocks go alike, and `t` was read first: the largest difference is the true one, and stamps
        # never go back.
        self._offset_ns = max(self._offset_ns, t - round(now * 1e9))
        states = watch.poll(now)
        return [
            s
            for name, stylus in self._styluses.items()
            for s in stylus.read(states.get(name, []), watch.lost.get(name), self._offset_ns)
        ]

    def write(self, port: str, value: Value) -> None:
        """Take a contact model, which is rendered from the next tick on.

        Raises MessageError for another port or type.
        """
        name, _, what = port.partition("/")
        if what != "contact" or name not in self._styluses or not isinstance(value, ContactModel):
            takes = ", ".join(f"{stylus}/contact" for stylus in self._styluses)
            raise MessageError(
                f"'{self.name}' takes a ContactModel on {takes}, not {type(value).__name__} on '{port}'"
            )
        process = None if self._watch is None else self._watch.process
        if process is not None and name in process.models:
            with self._writing:
                process.models[name].write(
                    model_doubles(planes_of(value), value.header.stamp.ns, perf_counter())
                )

    def close(self) -> None:
        """Give the hands a last frame without force, and the devices back."""
        if self._watch is not None:
            self._watch.close()
        self._watch = None

    def _new(self) -> dict[str, _Stylus]:
        return {
            stylus: _Stylus(self.name, stylus, params, self.params.max_age)
            for stylus, params in self.params.styluses.items()
        }

    def _opened(self, process: ServoProcess, message: dict[str, Any]) -> None:
        self._styluses[message["stylus"]].opened(process, message["hardware"], message["limits"])


class _Stylus:
    """What is told of one stylus."""

    def __init__(self, participant: str, stylus: str, params: StylusParams, max_age_ns: int) -> None:
        self._name, self._params = stylus, params
        self._ports = stylus_ports(participant, stylus, clock="wall", max_age_ns=max_age_ns)
        self._diagnosis = Diagnosis(f"{participant}/{stylus}", f"{stylus}/diagnostics")
        self.ports = (*self._ports, self._diagnosis.port)
        self._hardware = self._refusal = ""
        self._pressed: tuple[bool, ...] | None = None
        self._stamp_ns = 0
        self._posed = False
        self._settling: float | None = None

    def opened(self, process: ServoProcess, hardware: str, stated: dict[str, float]) -> None:
        """Let `process` give force within the scenario's limits, if the device bears them.

        What it does not state is that of a Touch.
        """
        self._hardware, self._refusal = hardware, ""
        bears = DeviceLimits(
            *(
                stated[name] if stated[name] > 0.0 else getattr(TOUCH, name)
                for name in ("force", "stiffness", "damping")
            )
        )
        try:
            process.allow(
                self._name, self._params.safety.within(bears), passivity=self._params.safety.passivity
            )
        except ScenarioError as error:
            self._refusal = str(error)

    def read(self, states: list[State], lost: Lost | None, offset_ns: int) -> list[Sample]:
        """Return the samples of these states, in the clock that is `offset_ns` ahead of time.perf_counter."""
        if lost is not None:
            diagnosis = (
                diagnoses.FOUND
                if lost.found
                else diagnoses.lost(lost.phase, lost.code, lost.cause, self._params.device)
            )
            return [*self._gone(), *self._diagnosis.tell(*diagnosis, self._hardware)]
        samples: list[Sample] = []
        for state in states:
            samples += self._buttons(state, offset_ns)
        if states:
            samples += self._newest(states[-1], offset_ns)
        return samples

    def _buttons(self, state: State, offset_ns: int) -> list[Sample]:
        pressed = tuple(bool(state.buttons >> i & 1) for i in range(_BUTTONS))
        if pressed == self._pressed or not Phase(state.phase).has_pose:
            return []
        self._pressed = pressed
        return [button_sample(self._ports.buttons, self._time_ns(state, offset_ns), pressed)]

    def _newest(self, state: State, offset_ns: int) -> list[Sample]:
        phase = Phase(state.phase)
        if phase is not Phase.SETTLING:
            self._settling = None
        elif self._settling is None:
            self._settling = state.time
        soon = self._settling is not None and state.time - self._settling < _SETTLING
        told = [] if soon else self._diagnosis.tell(*diagnoses.present(state, self._refusal), self._hardware)
        if not phase.has_pose:
            return [*self._gone(), *told]
        self._posed = True
        time_ns = self._time_ns(state, offset_ns)
        x, y, z, w = rotation.from_matrix(np.array(state.rotation).reshape(3, 3)).tolist()
        return [
            pose_sample(self._ports.pose, time_ns, state.position, (x, y, z, w)),
            twist_sample(self._ports.twist, time_ns, state.linear, state.angular),
            force_sample(self._ports.force, time_ns, state.force),
            *told,
        ]

    def _gone(self) -> list[Sample]:
        """Return the last force, which is none, when the stylus has just been lost."""
        if not self._posed:
            return []
        self._posed = False
        return [force_sample(self._ports.force, self._stamp_ns, ZERO)]

    def _time_ns(self, state: State, offset_ns: int) -> int:
        self._stamp_ns = max(self._stamp_ns, round(state.time * 1e9) + offset_ns)
        return self._stamp_ns
