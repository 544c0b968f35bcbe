"""State of participants: typed records, each in a float64 vector of its own, and the hash over such vectors.

    class Trajectory(Record):
        position = array("n")
        activity = choice(Activity.HOLD)
        pending = flag()

    state = Trajectory(n=6)
    state.position[:] = goal  # a view, written in place
    state.activity = Activity.MOVE

The vector is hashed and saved: nothing has to be collected, and no field can be forgotten.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from enum import IntEnum
from math import copysign, prod
from operator import attrgetter
from typing import ClassVar, TypeVar, cast

import numpy as np

from schemas.errors import StateError
from schemas.vectors import Vector, join_parts

__all__ = [
    "Record",
    "array",
    "choice",
    "flag",
    "integer",
    "number",
    "restore_arrays",
    "split_state",
    "state_hash",
]

E = TypeVar("E", bound=IntEnum)

_TAKEN = ("values", "numbers", "offsets")
_MOST = 2**53
"""Integers up to here, of either sign, are exact as float64."""


def state_hash(*parts: bytes | Vector) -> int:
    """Return a 64-bit hash of `parts`, the same on every machine for the same bits.

    Examples:
        state_hash(self.position, self.velocity, b"grasped")
    """
    return int.from_bytes(hashlib.blake2b(join_parts(parts), digest_size=8).digest(), "little")


def restore_arrays(participant: str, arrays: Iterable[Vector], state: bytes) -> None:
    """Write `state`, the concatenated bytes of `arrays`, back into the arrays.

        state = position.tobytes() + velocity.tobytes()
        restore_arrays(self.name, [position, velocity], state)

    `participant` is the name for the message. Raises StateError if `state` has another size.
    """
    held = tuple(arrays)
    for array, values in zip(held, split_state(participant, held, state), strict=True):
        array[...] = values


def split_state(participant: str, arrays: Sequence[Vector], state: bytes) -> list[Vector]:
    """Return the part of `state` for each of `arrays`, in their shapes; StateError if the size differs."""
    size = sum(array.nbytes for array in arrays)
    if len(state) != size:
        raise StateError(
            f"participant '{participant}': a saved state of {len(state)} bytes, expected {size}; was it saved"
            " elsewhere?"
        )
    values, found, at = np.frombuffer(state), list[Vector](), 0
    for array in arrays:
        found.append(values[at : at + array.size].reshape(array.shape))
        at += array.size
    return found


def array(*shape: int | str) -> Vector:
    """Declare an array of float64, zero at first; a named dimension is an argument of the record."""
    return cast("Vector", _Array(shape))


def number(start: float = 0.0) -> float:
    """Declare a float."""
    return cast("float", _Number(start))


def flag(*, start: bool = False) -> bool:
    """Declare a bool."""
    return cast("bool", _Flag(start))


def integer(start: int = 0) -> int:
    """Declare an int of at most 53 bits and a sign."""
    return cast("int", _Integer(start))


def choice(start: E) -> E:
    """Declare a member of the enumeration of `start`."""
    return cast("E", _Choice(start))


class _Field(ABC):
    """A declared part of a record."""

    start: float = 0.0
    allowed = "any number"

    def shape(self, sizes: Mapping[str, int]) -> tuple[int, ...]:  # noqa: ARG002
        return ()

    def is_valid(self, value: float) -> bool:  # noqa: ARG002
        """Return whether `value` stands for something; 0 and -0 are not the same."""
        return True

    @abstractmethod
    def accessor(self, name: str, index: int) -> property:
        """Return the property that reads and writes the field, number `index` of the record."""


class _Array(_Field):
    def __init__(self, shape: tuple[int | str, ...]) -> None:
        self._shape = shape

    def shape(self, sizes: Mapping[str, int]) -> tuple[int, ...]:
        return tuple(sizes[size] if isinstance(size, str) else size for size in self._shape)

    def accessor(self, name: str, index: int) -> property:  # noqa: ARG002
        def write(record: Record, value: Vector) -> None:
            getattr(record, _view_name(name))[...] = value

        return property(attrgetter(_view_name(name)), write)


class _Number(_Field):
    def __init__(self, start: float) -> None:
        self.start = start

    def accessor(self, name: str, index: int) -> property:  # noqa: ARG002
        def read(record: Record) -> float:
            return record.numbers[record.offsets[index]]

        def write(record: Record, value: float) -> None:
            record.numbers[record.offsets[index]] = value

        return property(read, write)


class _Flag(_Number):
    allowed = "0 (False) and 1 (True)"

    def is_valid(self, value: float) -> bool:
        return value == 1.0 or (value == 0.0 and copysign(1.0, value) > 0.0)

    def accessor(self, name: str, index: int) -> property:  # noqa: ARG002
        def read(record: Record) -> bool:
            return record.numbers[record.offsets[index]] != 0.0

        def write(record: Record, value: bool) -> None:
            record.numbers[record.offsets[index]] = 1.0 if value else 0.0

        return property(read, write)


class _Integer(_Number):
    allowed = "whole numbers from -2^53 to 2^53"

    def is_valid(self, value: float) -> bool:
        is_whole = value.is_integer() and abs(value) <= _MOST
        return is_whole and (value != 0.0 or copysign(1.0, value) > 0.0)

    def accessor(self, name: str, index: int) -> property:
        def read(record: Record) -> int:
            return int(record.numbers[record.offsets[index]])

        def write(record: Record, value: int) -> None:
            if not -_MOST <= value <= _MOST:
                raise StateError(f"{type(record).__name__}.{name} = {value}, allowed are {self.allowed}")
            record.numbers[record.offsets[index]] = value

        return property(read, write)


class _Choice(_Number):
    def __init__(self, start: IntEnum) -> None:
        super().__init__(start)
        self._members = {float(member): member for member in type(start)}
        self.allowed = ", ".join(f"{member:d} ({member.name})" for member in type(start))

    def is_valid(self, value: float) -> bool:
        return value in self._members and (value != 0.0 or copysign(1.0, value) > 0.0)

    def accessor(self, name: str, index: int) -> property:  # noqa: ARG002
        members = self._members

        def read(record: Record) -> IntEnum:
            return members[record.numbers[record.offsets[index]]]

        def write(record: Record, value: IntEnum) -> None:
            record.numbers[record.offsets[index]] = value

        return property(read, write)


def _view_name(name: str) -> str:
    return f"view_of_{name}"


class Record:
    """State with named fields, declared in the class body: `array`, `number`, `flag`, `integer`, `choice`.

    The fields stand in `values` in the order of their declaration.
    """

    fields: ClassVar[Mapping[str, _Field]] = {}

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        declared = {name: field for name, field in vars(cls).items() if isinstance(field, _Field)}
        if taken := [name for name in declared if hasattr(Record, name) or name in _TAKEN]:
            raise TypeError(f"{cls.__name__}: {', '.join(taken)} cannot be the name of a field")
        first = len(cls.fields)
        cls.fields = {**cls.fields, **declared}
        for index, (name, field) in enumerate(declared.items(), first):
            setattr(cls, name, field.accessor(name, index))

    def __init__(self, **sizes: int) -> None:
        """Give the dimensions named in the declaration."""
        shapes = {name: field.shape(sizes) for name, field in self.fields.items()}
        lengths = [prod(shape) for shape in shapes.values()]
        self.values = np.zeros(sum(lengths))
        """The whole state, shape (size,)."""
        # indexing a memoryview is quicker than indexing an array, and gives a float of Python's
        self.numbers = cast("memoryview[float]", self.values.data)
        self.offsets = tuple(sum(lengths[:i]) for i in range(len(lengths)))
        for (name, shape), offset, length in zip(shapes.items(), self.offsets, lengths, strict=True):
            field, part = self.fields[name], self.values[offset : offset + length]
            if isinstance(field, _Array):
                setattr(self, _view_name(name), part.reshape(shape))
            else:
                part[:] = field.start

    def part(self, name: str) -> Vector:
        """Return a field's view of `values`: shape (1,) for a number, as in outputs."""
        index = list(self.fields).index(name)
        end = (*self.offsets[1:], self.values.size)[index]
        return self.values[self.offsets[index] : end]

    def check(self, values: Vector) -> None:
        """Raise StateError if `values`, shape (size,), cannot be values of this record."""
        for (name, field), offset in zip(self.fields.items(), self.offsets, strict=True):
            if not isinstance(field, _Array) and not field.is_valid(value := float(values[offset])):
                raise StateError(f"{type(self).__name__}.{name} = {value:g}, allowed are {field.allowed}")
