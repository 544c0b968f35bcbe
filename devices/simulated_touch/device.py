"""Kind `simulated-touch`: a haptic stylus and a hand in simulated time.

Ports, renderer and safety chain at 1 kHz are the same as with a real stylus.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from devices.diagnosis import Diagnosis
from devices.haptics.contact import Plane, planes_of
from devices.haptics.diagnoses import FORCE_DIAGNOSES
from devices.haptics.limits import TOUCH
from devices.haptics.loop import HapticLoop
from devices.haptics.ports import StylusPorts, StylusSamples, stylus_ports
from devices.haptics.safety import Condition
from devices.samples import button_sample
from devices.simulated_touch.hand import SimulatedHand
from devices.simulated_touch.params import SimulatedStylusParams, SimulatedTouchParams
from devices.simulated_touch.path import recorded_path, waypoint_path
from hub.participant import Device, Params, Sample, Value
from schemas.errors import MessageError
from schemas.ports import Port
from schemas.trocar_msgs import ContactModel

__all__ = ["SimulatedTouch"]

_TICK_NS = 1_000_000
"""The servo period of real devices."""


class SimulatedTouch(Device):
    """Styluses in simulated hands, each with the limits of a Touch.

    A scenario may have the kind `touch` instead.
    """

    params_model: ClassVar[type[Params]] = SimulatedTouchParams
    params: SimulatedTouchParams
    simulated_time = True

    def __init__(self, name: str, params: SimulatedTouchParams) -> None:
        super().__init__(name, params)
        self._ports = {
            stylus: stylus_ports(name, stylus, simulated_time=self.simulated_time, max_age_ns=params.max_age)
            for stylus in params.styluses
        }
        self._styluses: dict[str, _Stylus] = {}

    @property
    def ports(self) -> tuple[Port, ...]:
        """Of each stylus: `pose`, `twist`, `buttons`, `force` and `diagnostics` out, `contact` in."""
        return tuple(
            port
            for stylus, ports in self._ports.items()
            for port in (*ports, _diagnosis(self.name, stylus).port)
        )

    def open(self, directory: Path) -> None:  # noqa: ARG002
        """Put the hands at the starts of their paths. Raises RecordingError if a recording has no path."""
        self._styluses = {
            stylus: _Stylus(self.name, stylus, self.params.styluses[stylus], ports)
            for stylus, ports in self._ports.items()
        }

    def read(self, t: int) -> list[Sample]:
        """Move the hands up to `t` (ns), and return the new samples."""
        return [sample for stylus in self._styluses.values() for sample in stylus.read(t)]

    def write(self, port: str, value: Value) -> None:
        """Pass on a contact model, rendered from the next `read` on.

        Raises MessageError for another port or type.
        """
        name, _, what = port.partition("/")
        if what != "contact" or name not in self._ports or not isinstance(value, ContactModel):
            known = ", ".join(f"'{stylus}/contact'" for stylus in self._ports)
            raise MessageError(
                f"'{self.name}' takes a ContactModel on {known}; this is a {type(value).__name__} on '{port}'"
            )
        if name in self._styluses:
            self._styluses[name].receive(value)

    def close(self) -> None:
        """Discard the styluses."""
        self._styluses = {}


def _diagnosis(participant: str, stylus: str) -> Diagnosis:
    return Diagnosis(f"{participant}/{stylus}", f"{stylus}/diagnostics", simulated_time=True)


class _Stylus:
    """A stylus: at every tick a force follows from the hand's position, and the force moves the hand."""

    def __init__(
        self, participant: str, stylus: str, params: SimulatedStylusParams, ports: StylusPorts
    ) -> None:
        self._ports, self._samples = ports, StylusSamples(ports)
        self._diagnosis = _diagnosis(participant, stylus)
        self._path = (
            recorded_path(params.path, stylus, params.dead_man)
            if isinstance(params.path, Path)
            else waypoint_path(params.path)
        )
        self._loop = HapticLoop(params.safety.within(TOUCH), passivity=params.safety.passivity)
        self._dead_man = params.dead_man
        hand = params.hand
        self._hand = SimulatedHand(
            hand.mass, hand.stiffness, hand.damping, _TICK_NS * 1e-9, self._path.position(0.0)[0]
        )
        self._ticks = 0
        self._written: tuple[tuple[Plane, ...], int] | None = None
        self._written_ns: int | None = None
        self._pressed: tuple[bool, bool] | None = None
        self._condition: Condition | None = None

    def receive(self, model: ContactModel) -> None:
        """Keep a contact model until the tick of the writing, the time of the next `read`."""
        self._written, self._written_ns = (planes_of(model), model.header.stamp.ns), None

    def read(self, t: int) -> list[Sample]:
        """Advance to the last tick up to `t` (ns); return events of every tick and the state of the last."""
        if self._written_ns is None:
            self._written_ns = t
        due = t // _TICK_NS + 1 - self._ticks
        if due <= 0:
            return []
        samples: list[Sample] = []
        for _ in range(due):
            samples += self._tick()
        time_ns = (self._ticks - 1) * _TICK_NS
        orientation, angular = self._path.orientation(time_ns * 1e-9)
        return [
            *samples,
            self._samples.pose(time_ns, self._hand.position, orientation),
            self._samples.twist(time_ns, self._hand.velocity, angular),
            self._samples.force(time_ns, self._loop.force),
        ]

    def _tick(self) -> list[Sample]:
        """Advance to the next tick, and compute the force from there on."""
        time_ns = self._ticks * _TICK_NS
        now = time_ns * 1e-9
        if self._ticks:
            self._hand.move(self._loop.force, *self._path.position(now - _TICK_NS * 1e-9))
        self._ticks += 1
        if self._written is not None and self._written_ns is not None and time_ns >= self._written_ns:
            self._loop.receive(*self._written, now)
            self._written = None
        pressed = self._path.buttons(now)
        self._loop.tick(now, self._hand.position, self._hand.velocity, permitted=pressed[self._dead_man])
        samples: list[Sample] = []
        if pressed != self._pressed:
            self._pressed = pressed
            samples.append(button_sample(self._ports.buttons, time_ns, pressed))
        if self._loop.condition is not self._condition:
            self._condition = self._loop.condition
            samples += self._diagnosis.report(*FORCE_DIAGNOSES[self._condition])
        return samples
