"""Kind `simulated-touch`: the ports of a haptic stylus, the same renderer and safety chain at 1 kHz, and a
simulated hand in simulated time.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from devices.diagnosis import Diagnosis
from devices.haptics.contact import Plane, planes_of
from devices.haptics.diagnoses import FORCE_DIAGNOSES
from devices.haptics.limits import TOUCH
from devices.haptics.loop import HapticLoop
from devices.haptics.ports import StylusPorts, force_sample, stylus_ports
from devices.haptics.safety import Condition
from devices.samples import button_sample, pose_sample, twist_sample
from devices.simulated_touch.hand import Hand
from devices.simulated_touch.params import SimulatedStylusParams, SimulatedTouchParams
from devices.simulated_touch.path import recorded, scripted
from hub.participant import Device, Params, Sample, Value
from schemas.errors import MessageError
from schemas.ports import Port
from schemas.trocar_msgs import ContactModel

__all__ = ["SimulatedTouch"]

_TICK_NS = 1_000_000
"""The servo period of the devices that this one stands for."""


class SimulatedTouch(Device):
    """Styluses in simulated hands, each with the limits of a Touch.

    A scenario may have the kind `touch` in its place.
    """

    params_model: ClassVar[type[Params]] = SimulatedTouchParams
    params: SimulatedTouchParams

    def __init__(self, name: str, params: SimulatedTouchParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._ports = {
            stylus: stylus_ports(name, stylus, clock="simulated", max_age_ns=params.max_age)
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
        """Put the hands where their paths begin. Raises RecordingError if a path is a recording without one."""
        self._styluses = {
            stylus: _Stylus(self.name, stylus, self.params.styluses[stylus], ports)
            for stylus, ports in self._ports.items()
        }

    def read(self, t: int) -> list[Sample]:
        """Let the hands move up to `t` (ns), and return what is new."""
        return [sample for stylus in self._styluses.values() for sample in stylus.read(t)]

    def write(self, port: str, value: Value) -> None:
        """Take a contact model. It is felt from the next `read` on.

        Raises MessageError for another port or type.
        """
        name, _, what = port.partition("/")
        if what != "contact" or name not in self._ports or not isinstance(value, ContactModel):
            known = ", ".join(f"'{stylus}/contact'" for stylus in self._ports)
            raise MessageError(
                f"'{self.name}' takes a ContactModel on {known}; this is a {type(value).__name__} on '{port}'"
            )
        if name in self._styluses:
            self._styluses[name].take(value)

    def close(self) -> None:
        """Let go of the styluses."""
        self._styluses = {}


def _diagnosis(participant: str, stylus: str) -> Diagnosis:
    return Diagnosis(f"{participant}/{stylus}", f"{stylus}/diagnostics", clock="simulated")


class _Stylus:
    """One stylus: at every tick the force follows from where the hand is, and then both go on together."""

    def __init__(
        self, participant: str, stylus: str, params: SimulatedStylusParams, ports: StylusPorts
    ) -> None:
        self._ports = ports
        self._diagnosis = _diagnosis(participant, stylus)
        self._path = (
            recorded(params.path, stylus, params.dead_man)
            if isinstance(params.path, Path)
            else scripted(params.path)
        )
        self._loop = HapticLoop(params.safety.within(TOUCH), passivity=params.safety.passivity)
        self._dead_man = params.dead_man
        hand = params.hand
        self._hand = Hand(
            hand.mass, hand.stiffness, hand.damping, _TICK_NS * 1e-9, self._path.position(0.0)[0]
        )
        self._ticks = 0
        self._written: tuple[tuple[Plane, ...], int] | None = None
        self._written_ns: int | None = None
        self._pressed: tuple[bool, bool] | None = None
        self._condition: Condition | None = None

    def take(self, model: ContactModel) -> None:
        """Keep a contact model until `read` has come to the time at which it was written, which is the one
        that `read` is called with.
        """
        self._written, self._written_ns = (planes_of(model), model.header.stamp.ns), None

    def read(self, t: int) -> list[Sample]:
        """Go on to the last tick up to `t`, and return the samples: events of every tick, the state of the
        last one.
        """
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
            pose_sample(self._ports.pose, time_ns, self._hand.position, orientation),
            twist_sample(self._ports.twist, time_ns, self._hand.velocity, angular),
            force_sample(self._ports.force, time_ns, self._loop.force),
        ]

    def _tick(self) -> list[Sample]:
        """Move to the next tick, and take the force that holds from there."""
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
            samples += self._diagnosis.tell(*FORCE_DIAGNOSES[self._condition])
        return samples
