"""The base of stepped participants with the whole state in records and arrays."""

from __future__ import annotations

from hub.participant.state import Record, split_state, state_hash
from hub.participant.stepped import Stepped
from schemas.errors import StateError
from schemas.vectors import Vector

__all__ = ["Controller"]


class Controller(Stepped):
    """A stepped participant without physics.

    Records and arrays are named once, by `keep`; hash, save and restore follow.
    """

    _kept: tuple[Record | Vector, ...] = ()
    _arrays: tuple[Vector, ...] = ()

    def keep(self, *state: Record | Vector) -> None:
        """Declare the whole state, replacing an earlier declaration."""
        self._kept = state
        self._arrays = tuple(part.values if isinstance(part, Record) else part for part in state)

    def state_hash(self) -> int:
        """Return the hash of the whole state."""
        return state_hash(*self._arrays)

    def save(self) -> bytes:
        """Return the bytes of the whole state, in the order of declaration."""
        return b"".join(array.tobytes() for array in self._arrays)

    def restore(self, state: bytes) -> None:
        """Return to a saved state, bit for bit.

        Raises StateError, and changes nothing, if the size is wrong or a field cannot have the value.
        """
        values = split_state(self.name, self._arrays, state)
        for part, saved in zip(self._kept, values, strict=True):
            if isinstance(part, Record):
                try:
                    part.check(saved)
                except StateError as error:
                    raise StateError(
                        f"participant '{self.name}': a saved state with {error}; was it saved elsewhere?"
                    ) from error
        for array, saved in zip(self._arrays, values, strict=True):
            array[...] = saved

    def close(self) -> None:
        """Do nothing: there is nothing to give back."""
