"""A haptic device: styluses behind a driver in the servo process."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from devices.diagnosis import Diagnosis
from devices.haptics.contact import ZERO, planes_of
from devices.haptics.limits import TOUCH, DeviceLimits
from devices.haptics.ports import StylusSamples, stylus_ports
from devices.haptics.servo import diagnoses
from devices.haptics.servo.exchange import State, model_doubles
from devices.haptics.servo.params import ServoStylusParams
from devices.haptics.servo.phase import ServoPhase
from devices.haptics.servo.process import DriverChoice, ServoProcess
from devices.haptics.servo.supervisor import Lost, Supervisor
from devices.samples import button_sample
from hub.participant import Device, Params, Sample, Value
from robots import rotation
from schemas.errors import MessageError, ScenarioError
from schemas.ports import Port
from schemas.trocar_msgs import ContactModel

__all__ = ["HapticDevice"]

_SETTLING = 1.0
"""Time without valid frames until the diagnosis says so, s: the first frames never are valid."""


class HapticDevice(Device):
    """The styluses of this machine; a kind states the driver and the parameters of each stylus.

    An absent, busy, uncalibrated or faulty stylus gives no pose, twist or force; the diagnosis has the
    remedy, and a stylus back at work is used at once.
    """

    driver: ClassVar[str]
    """The class of the driver, `module:Class`; imported by the servo process alone."""
    words: ClassVar[diagnoses.Words] = diagnoses.Words()
    buttons: ClassVar[int] = 2

    def __init__(
        self, name: str, params: Params, styluses: Mapping[str, ServoStylusParams], max_age_ns: int
    ) -> None:
        """Declare the ports of the styluses, by name.

        Args:
            name: the participant's name.
            params: parameters of the participant.
            styluses: parameters of each stylus.
            max_age_ns: age of a stale pose or twist.
        """
        super().__init__(name, params)
        self._stylus_params, self._max_age_ns = dict(styluses), max_age_ns
        self._styluses = self._new()
        self._supervisor: Supervisor | None = None
        self._writing = threading.Lock()
        self._offset_ns = 0

    @property
    def ports(self) -> tuple[Port, ...]:
        """Of each stylus: `pose`, `twist`, `buttons`, `force` and `diagnostics` out, `contact` in."""
        return tuple(port for stylus in self._styluses.values() for port in stylus.ports)

    def open(self, directory: Path) -> None:
        """Start the servo process.

        Raises DeviceError if the driver cannot be loaded; a missing stylus is looked for later.
        """
        driver = DriverChoice(self.driver, self.driver_options(directory))
        self._styluses = self._new()
        self._offset_ns = -(2**63)
        self._supervisor = Supervisor(
            driver,
            {name: params.spec(name) for name, params in self._stylus_params.items()},
            self._start_stylus,
        )
        self._supervisor.start(perf_counter())

    def driver_options(self, directory: Path) -> dict[str, Any]:  # noqa: ARG002
        """Return the keyword arguments of the driver; `directory`: of the scenario."""
        return {}

    def read(self, t: int) -> list[Sample]:
        """Return every button event, the newest pose, twist and force, and changed diagnoses."""
        supervisor = self._supervisor
        if supervisor is None:
            return []
        now = perf_counter()
        # Both clocks run at the same rate, and `t` was read first: the largest difference is the true one,
        # and stamps never go back.
        self._offset_ns = max(self._offset_ns, t - round(now * 1e9))
        states = supervisor.poll(now)
        return [
            s
            for name, stylus in self._styluses.items()
            for s in stylus.read(states.get(name, []), supervisor.lost.get(name), self._offset_ns)
        ]

    def write(self, port: str, value: Value) -> None:
        """Pass on a contact model, rendered from the next tick on.

        Raises MessageError for another port or type.
        """
        name, _, what = port.partition("/")
        if what != "contact" or name not in self._styluses or not isinstance(value, ContactModel):
            takes = ", ".join(f"{stylus}/contact" for stylus in self._styluses)
            raise MessageError(
                f"'{self.name}' takes a ContactModel on {takes}, not {type(value).__name__} on '{port}'"
            )
        process = None if self._supervisor is None else self._supervisor.process
        if process is not None and name in process.models:
            with self._writing:
                process.models[name].write(
                    model_doubles(planes_of(value), value.header.stamp.ns, perf_counter())
                )

    def close(self) -> None:
        """Give the hands a last frame without force, and release the devices."""
        if self._supervisor is not None:
            self._supervisor.close()
        self._supervisor = None

    def _new(self) -> dict[str, _Stylus]:
        return {
            stylus: _Stylus(self, stylus, params, self._max_age_ns)
            for stylus, params in self._stylus_params.items()
        }

    def _start_stylus(self, process: ServoProcess, message: dict[str, Any]) -> None:
        self._styluses[message["stylus"]].allow_force(process, message["hardware"], message["limits"])


class _Stylus:
    """The samples of a stylus."""

    def __init__(self, device: HapticDevice, stylus: str, params: ServoStylusParams, max_age_ns: int) -> None:
        self._name, self._params = stylus, params
        self._words, self._button_count = device.words, device.buttons
        participant = device.name
        self._ports = stylus_ports(participant, stylus, simulated_time=False, max_age_ns=max_age_ns)
        self._samples = StylusSamples(self._ports)
        self._diagnosis = Diagnosis(f"{participant}/{stylus}", f"{stylus}/diagnostics")
        self.ports = (*self._ports, self._diagnosis.port)
        self._hardware = self._refusal = ""
        self._pressed: tuple[bool, ...] | None = None
        self._stamp_ns = 0
        self._posed = False
        self._settling: float | None = None

    def allow_force(self, process: ServoProcess, hardware: str, stated: dict[str, float]) -> None:
        """Allow `process` to give force within the scenario's limits, unless a limit exceeds the device's.

        A limit not stated by the device is that of a 3D Systems Touch.
        """
        self._hardware, self._refusal = hardware, ""
        limits = DeviceLimits(
            *(
                stated[name] if stated[name] > 0.0 else getattr(TOUCH, name)
                for name in ("force", "stiffness", "damping")
            )
        )
        try:
            process.allow(
                self._name, self._params.safety.within(limits), passivity=self._params.safety.passivity
            )
        except ScenarioError as error:
            self._refusal = str(error)

    def read(self, states: list[State], lost: Lost | None, offset_ns: int) -> list[Sample]:
        """Return the samples of these states, in the clock `offset_ns` ahead of time.perf_counter."""
        if lost is not None:
            diagnosis = (
                diagnoses.FOUND
                if lost.found
                else diagnoses.describe_loss(
                    lost.phase, self._error(lost.code), lost.cause, self._params.device
                )
            )
            return [*self._last_force(), *self._diagnosis.report(*diagnosis, self._hardware)]
        samples: list[Sample] = []
        for state in states:
            samples += self._buttons(state, offset_ns)
        if states:
            samples += self._newest(states[-1], offset_ns)
        return samples

    def _buttons(self, state: State, offset_ns: int) -> list[Sample]:
        pressed = tuple(bool(state.buttons >> i & 1) for i in range(self._button_count))
        if pressed == self._pressed or not ServoPhase(state.phase).has_pose:
            return []
        self._pressed = pressed
        return [button_sample(self._ports.buttons, self._time_ns(state, offset_ns), pressed)]

    def _newest(self, state: State, offset_ns: int) -> list[Sample]:
        phase = ServoPhase(state.phase)
        if phase is not ServoPhase.SETTLING:
            self._settling = None
        elif self._settling is None:
            self._settling = state.time
        soon = self._settling is not None and state.time - self._settling < _SETTLING
        reported = diagnoses.present(state, self._words, self._refusal)
        diagnosis = [] if soon else self._diagnosis.report(*reported, self._hardware)
        if not phase.has_pose:
            return [*self._last_force(), *diagnosis]
        self._posed = True
        time_ns = self._time_ns(state, offset_ns)
        x, y, z, w = rotation.from_matrix(np.array(state.rotation).reshape(3, 3)).tolist()
        return [
            self._samples.pose(time_ns, state.position, (x, y, z, w)),
            self._samples.twist(time_ns, state.linear, state.angular),
            self._samples.force(time_ns, state.force),
            *diagnosis,
        ]

    def _error(self, code: int) -> str:
        return self._words.error(code) if code else ""

    def _last_force(self) -> list[Sample]:
        """Return a force of zero when the stylus has just been lost."""
        if not self._posed:
            return []
        self._posed = False
        return [self._samples.force(self._stamp_ns, ZERO)]

    def _time_ns(self, state: State, offset_ns: int) -> int:
        self._stamp_ns = max(self._stamp_ns, round(state.time * 1e9) + offset_ns)
        return self._stamp_ns
