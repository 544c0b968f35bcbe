"""The state hashes of a run as a single hash: equal for equal runs, whatever the hosts and windows."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterable, Sequence

__all__ = ["StateDigests"]


class StateDigests:
    """Collects the state hashes of each participant, in the order of the steps."""

    def __init__(self, participants: Iterable[str]) -> None:
        self._digests = {name: hashlib.blake2b(digest_size=16) for name in participants}

    def add(self, participant: str, hashes: Sequence[int]) -> None:
        """Add the 64-bit hashes of a participant's next steps."""
        self._digests[participant].update(struct.pack(f"<{len(hashes)}Q", *hashes))

    @property
    def whole(self) -> str:
        """The hash of all so far, 32 hexadecimal digits."""
        digest = hashlib.blake2b(digest_size=16)
        for name, part in sorted(self._digests.items()):
            digest.update(name.encode() + part.digest())
        return digest.hexdigest()
