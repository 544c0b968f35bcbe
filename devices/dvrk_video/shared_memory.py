"""Memory of a picture that readers map: they may read, and can neither write nor shorten it."""

from __future__ import annotations

import fcntl
import mmap
import os

__all__ = ["PictureMemory"]

_SEAL_FUTURE_WRITE = 0x10
"""Linux 5.1; fcntl of Python 3.11 does not name it."""


class PictureMemory:
    """A file in memory of a fixed size, bytes, and the number of its holders."""

    def __init__(self, size: int) -> None:
        """Raises OSError if there is no memory."""
        self.size, self.holders = size, 0
        self.fd = os.memfd_create("trocar-picture", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        os.ftruncate(self.fd, size)
        self._view = mmap.mmap(self.fd, size)
        fcntl.fcntl(self.fd, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | _SEAL_FUTURE_WRITE)

    def fill(self, content: bytes) -> None:
        """Write a picture of the memory's size."""
        self._view[:] = content

    def close(self) -> None:
        """Let go of the memory; readers keep what they have mapped."""
        self._view.close()
        os.close(self.fd)
