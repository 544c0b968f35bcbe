"""State hashes and saved states of participants."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

import numpy as np

from schemas.errors import StateError
from schemas.vectors import Vector

__all__ = ["restore_arrays", "state_hash"]


def state_hash(*parts: bytes | Vector) -> int:
    """Return a 64-bit hash of `parts`, the same on every machine that has the same bits.

    Examples:
        state_hash(self.position, self.velocity, b"grasped")
    """
    digest = hashlib.blake2b(digest_size=8)
    for part in parts:
        digest.update(part if isinstance(part, bytes) else part.tobytes())
    return int.from_bytes(digest.digest(), "little")


def restore_arrays(participant: str, arrays: Iterable[Vector], state: bytes) -> None:
    """Write `state`, the bytes of `arrays` one after the other, back into them.

        state = position.tobytes() + velocity.tobytes()
        restore_arrays(self.name, [position, velocity], state)

    `participant` is the name for the message. Raises StateError if `state` has another size.
    """
    held = tuple(arrays)
    size = sum(array.nbytes for array in held)
    if len(state) != size:
        raise StateError(
            f"participant '{participant}': a saved state of {len(state)} bytes, expected {size}; was it saved"
            " elsewhere?"
        )
    values, at = np.frombuffer(state), 0
    for array in held:
        array[...] = values[at : at + array.size].reshape(array.shape)
        at += array.size
