"""A stylus inside the servo loop: condition, haptic loop and states.

The code runs a thousand times a second: plain floats, a single clock.
"""

from __future__ import annotations

from math import inf

from devices.haptics.contact import ZERO
from devices.haptics.limits import Limits
from devices.haptics.loop import HapticLoop
from devices.haptics.safety import Condition
from devices.haptics.servo.driver import Driver, Reading, StylusSpec
from devices.haptics.servo.exchange import RingReader, RingWriter, planes_in
from devices.haptics.servo.phase import ServoPhase
from devices.vendor_axes import Vector3

__all__ = ["Stylus"]

_CLEAN_FRAMES = 3
"""A driver's loop may start before the first frame of a device exists (hopezzzz/3dtouch, touch_hd.py)."""
_WARNING = 1.0
"""Time without a warning of the device until force may come back, s."""
_READY, _SETTLING = ServoPhase.READY, ServoPhase.SETTLING
"""Plain names: Python 3.11 takes 0.25 us to look up a member of an enumeration."""
_UNMOVED = Reading(ZERO, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), ZERO, valid=False)


class Stylus:
    """An open stylus. All methods but `allow` are for the servo loop."""

    def __init__(
        self, driver: Driver, handle: int, spec: StylusSpec, models: RingReader, states: RingWriter
    ) -> None:
        """Start without force; there is none before `allow`."""
        self.handle = handle
        self.phase = ServoPhase.SETTLING
        self._driver, self._spec, self._models, self._states = driver, spec, models, states
        self._reading = _UNMOVED
        self._loop: HapticLoop | None = None
        self._code = 0
        self._clean = self._placeholders = 0
        self._permitted = False
        self._warned = -inf

    def allow(self, limits: Limits, *, passivity: bool) -> None:
        """Allow force within `limits`."""
        self._loop = HapticLoop(limits, passivity=passivity)

    def frame(self, now: float, *, watched: bool) -> None:
        """Do a tick at `now` (s of time.perf_counter); without force if not `watched`."""
        self._reading = reading = self._driver.read(self.handle, now)
        dead_man = self._spec.dead_man
        self._permitted = (
            bool(reading.buttons >> dead_man & 1) if isinstance(dead_man, int) else reading.switch
        )
        self._judge(now, reading, watched=watched)
        self._driver.write(self.handle, self._render_force(now))

    def on_error(self, code: int, phase: ServoPhase, now: float) -> None:
        """Handle an error reported by the driver after the tick at `now`.

        Only the loss of the device ends the use of the stylus. Any lesser error switches the force off for a
        second: a warning asks for force off, and after an error of the tick the sent force is unknown. An
        uncalibrated stylus has no force.
        """
        if phase.is_lost:
            self.phase, self._code = phase, code
        elif self._reading.calibrated:
            self._warned, self._code = now, code

    def write_state(self, now: float) -> None:
        """Write the state of the tick at `now`."""
        reading, loop = self._reading, self._loop
        force, cause = (loop.force, _CAUSES[loop.condition]) if loop is not None else (ZERO, _OFF)
        head = (now, self.phase, self._code, reading.buttons, self._permitted, cause)
        self._states.write(
            (*head, *reading.position, *reading.rotation, *reading.linear, *reading.angular, *force)
        )

    def release(self) -> None:
        """Do the last tick, without force."""
        if self._loop is not None:
            self._loop.reset()
        self._driver.release(self.handle)

    def _judge(self, now: float, reading: Reading, *, watched: bool) -> None:
        phase = self.phase
        if phase.is_lost:
            return
        self._placeholders = 0 if reading.owned else self._placeholders + 1
        self._clean = self._clean + 1 if reading.valid and reading.owned else 0
        if self._placeholders >= _CLEAN_FRAMES:
            self.phase, self._code = ServoPhase.BUSY, 0
        elif self._clean < _CLEAN_FRAMES:
            self.phase = _SETTLING
        elif not reading.calibrated:
            self.phase, self._code = ServoPhase.UNCALIBRATED, reading.style
        elif now - self._warned < _WARNING:
            self.phase = ServoPhase.WARNED
        elif not watched:
            self.phase, self._code = ServoPhase.UNWATCHED, 0
        elif phase is not _READY:
            self.phase, self._code = _READY, 0

    def _render_force(self, now: float) -> Vector3:
        """Return the force (N) on the hand."""
        loop, reading = self._loop, self._reading
        if loop is None:
            return ZERO
        for record in self._models.read():
            loop.receive(planes_in(record), int(record[1]), record[0])
        return loop.tick(
            now, reading.position, reading.linear, permitted=self._permitted, ready=self.phase is _READY
        )


_CAUSES = {condition: i for i, condition in enumerate(Condition)}
_OFF = _CAUSES[Condition.OFF]
