"""Records of doubles in shared memory between a servo process and the device, without locks.

Each direction is a ring with a single writer and a single reader. A slot has a number, and a checksum over
number and content, so a reader recognises a record under change, on any processor. A writer's end half-way
leaves the slots before intact: neither side ever waits. The memory has no name: on Linux the reading process
inherits the file, on Windows the memory ends with the last handle.

Behind the rings is a counter, the sign of life of the watcher.
"""

from __future__ import annotations

import mmap
import os
import struct
import sys
import uuid
from collections.abc import Sequence
from typing import NamedTuple
from zlib import crc32

from devices.haptics.contact import Plane
from devices.vendor_axes import Vector3

__all__ = [
    "STYLUS_BYTES",
    "RingReader",
    "RingWriter",
    "State",
    "attach",
    "beat",
    "create",
    "device_ends",
    "memory_size",
    "model_doubles",
    "planes_in",
    "ring_size",
    "servo_ends",
]

_HEAD = struct.Struct("<QI4x")
_COUNTER = 8

MODEL_SLOTS, STATE_SLOTS = 2, 64
"""Slots of the rings of models and states. Only the newest model counts. States contain the buttons; a reader
may pause for some hundredths of a second without loss.
"""
MOST_PLANES = 4
MODEL_DOUBLES = 3 + MOST_PLANES * len(Plane._fields)
"""Numbers of a contact model: arrival (s of time.perf_counter), stamp (ns), number of planes, the planes."""
STATE_DOUBLES = 6 + 3 + 9 + 3 + 3 + 3


def model_doubles(planes: Sequence[Plane], stamp_ns: int, arrived: float) -> list[float]:
    """Return a contact model of at most four planes as numbers."""
    numbers = [arrived, float(stamp_ns), float(len(planes))]
    for plane in planes:
        numbers.extend(plane)
    return numbers + [0.0] * (MODEL_DOUBLES - len(numbers))


def planes_in(record: Sequence[float]) -> list[Plane]:
    """Return the planes in a record made by `model_doubles`."""
    width = len(Plane._fields)
    return [Plane(*record[3 + width * i : 3 + width * (i + 1)]) for i in range(int(record[2]))]


class State(NamedTuple):
    """A tick of a stylus, base frame, SI units."""

    time: float
    """Begin of the tick, s of time.perf_counter, shared by all processes of a machine."""
    phase: int
    """A `devices.haptics.servo.phase.ServoPhase`."""
    code: int
    """The driver's number: the error of the phase, the calibration style of an uncalibrated stylus, or 0."""
    buttons: int
    """Bit 0 is the first."""
    permitted: int
    """1 if the dead-man is held."""
    cause: int
    """Why the force is on or off: index into the participants of devices.haptics.safety.Condition."""
    position: Vector3
    """Tip position, m."""
    rotation: tuple[float, ...]
    """Rotation matrix of the stylus' own frame, nine numbers, row after row."""
    linear: Vector3
    """Velocity of the tip, m/s."""
    angular: Vector3
    """rad/s."""
    force: Vector3
    """On the hand, N."""

    @classmethod
    def of(cls, record: tuple[float, ...]) -> State:
        """Return the state in a record of the ring."""
        phase, code, buttons, permitted, cause = map(int, record[1:6])
        position, linear, angular, force = (
            (record[i], record[i + 1], record[i + 2]) for i in (6, 18, 21, 24)
        )
        return cls(
            record[0], phase, code, buttons, permitted, cause, position, record[9:18], linear, angular, force
        )


def ring_size(slots: int, doubles: int) -> int:
    """Return the size of a ring, bytes."""
    return _COUNTER + slots * (_HEAD.size + 8 * doubles)


class _Ring:
    def __init__(self, memory: memoryview, slots: int, doubles: int) -> None:
        """Use `memory`, `ring_size` bytes from a multiple of 8 on."""
        self._slots = slots
        self._record = struct.Struct(f"<{doubles}d")
        self._size = _HEAD.size + self._record.size
        self._newest = memory[:_COUNTER].cast("Q")
        self._memory = memory[_COUNTER : _COUNTER + slots * self._size]


class RingWriter(_Ring):
    """The writing end."""

    def write(self, record: Sequence[float]) -> None:
        """Add a record."""
        number = self._newest[0] + 1
        content = self._record.pack(*record)
        at = number % self._slots * self._size
        self._memory[at : at + self._size] = _HEAD.pack(number, crc32(content, number & 0xFFFFFFFF)) + content
        self._newest[0] = number


class RingReader(_Ring):
    """The reading end."""

    _seen = 0

    def read(self) -> list[tuple[float, ...]]:
        """Return the records since the last call, oldest first, without overwritten records."""
        newest = self._newest[0]
        if newest == self._seen:
            return []
        first = max(self._seen + 1, newest - self._slots + 1)
        found = [
            record
            for number in range(first, newest + 1)
            if (record := self._intact_record(number)) is not None
        ]
        self._seen = newest
        return found

    def _intact_record(self, number: int) -> tuple[float, ...] | None:
        at = number % self._slots * self._size
        slot = bytes(self._memory[at : at + self._size])
        content = slot[_HEAD.size :]
        if _HEAD.unpack_from(slot) != (number, crc32(content, number & 0xFFFFFFFF)):
            return None
        return self._record.unpack(content)


STYLUS_BYTES = ring_size(MODEL_SLOTS, MODEL_DOUBLES) + ring_size(STATE_SLOTS, STATE_DOUBLES)
"""Size of the shared memory per stylus, bytes."""
_BEAT_BYTES = 8


def memory_size(styluses: int) -> int:
    """Return the bytes of shared memory for this number of styluses."""
    return styluses * STYLUS_BYTES + _BEAT_BYTES


def beat(memory: memoryview) -> memoryview:
    """Return the watcher's counter: a single integer, 0 before the watcher runs."""
    return memory[-_BEAT_BYTES:].cast("Q")


def servo_ends(memory: memoryview, index: int) -> tuple[RingReader, RingWriter]:
    """Return the servo process' ends for stylus `index`: reader of contact models, writer of states."""
    models, states = _parts(memory, index)
    return RingReader(models, MODEL_SLOTS, MODEL_DOUBLES), RingWriter(states, STATE_SLOTS, STATE_DOUBLES)


def device_ends(memory: memoryview, index: int) -> tuple[RingWriter, RingReader]:
    """Return the device's ends: writer of contact models, reader of states."""
    models, states = _parts(memory, index)
    return RingWriter(models, MODEL_SLOTS, MODEL_DOUBLES), RingReader(states, STATE_SLOTS, STATE_DOUBLES)


def _parts(memory: memoryview, index: int) -> tuple[memoryview, memoryview]:
    stylus = memory[index * STYLUS_BYTES : (index + 1) * STYLUS_BYTES]
    split = ring_size(MODEL_SLOTS, MODEL_DOUBLES)
    return stylus[:split], stylus[split:]


def create(size: int) -> tuple[mmap.mmap, int | str]:
    """Return new shared memory, and a handle for `attach` in an inheriting process.

    The handle is a file descriptor, to be closed by the caller, or on Windows a name.
    """
    if sys.platform == "win32":
        name = f"trocar-{uuid.uuid4()}"
        return mmap.mmap(-1, size, tagname=name), name
    file = os.memfd_create("trocar-styluses")
    os.truncate(file, size)
    return mmap.mmap(file, size), file


def attach(handle: int | str, size: int) -> mmap.mmap:
    """Return the memory created by another process."""
    if sys.platform == "win32":
        return mmap.mmap(-1, size, tagname=str(handle))
    return mmap.mmap(int(handle), size)
