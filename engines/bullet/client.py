"""A connection to Bullet's physics server inside this process. Several may live side by side."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Generator
from contextlib import contextmanager

from schemas.errors import MissingExtraError, SessionError

__all__ = ["connect", "disconnect", "quiet"]


@contextmanager
def quiet() -> Generator[None]:
    """Keep what Bullet prints while it connects and loads off stdout, which may carry JSON; stderr stays as it is.

    Bullet prints through C's buffer, which therefore is flushed before stdout is put back.
    """
    sys.stdout.flush()
    libc = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)
    saved = os.dup(1)
    try:
        with open(os.devnull, "wb") as nowhere:  # noqa: PTH123  a device, not a file
            os.dup2(nowhere.fileno(), 1)
        yield
    finally:
        libc.fflush(None)
        os.dup2(saved, 1)
        os.close(saved)


def connect(part: str, timestep: float, gravity: float) -> int:
    """Return a new world of deformable bodies, stepped by `timestep` (s), with `gravity` (m/s^2) along -z.

    Raises MissingExtraError, naming `part`, where pybullet is not installed.
    """
    with quiet():
        try:
            import pybullet as bullet
        except ImportError as error:
            raise MissingExtraError(part, "bullet", "pybullet") from error
        client = bullet.connect(bullet.DIRECT)
        if client < 0:
            raise SessionError(f"{part}: Bullet gave no physics client; it allows a limited number in one process, so spread the engines over hosts")
        bullet.resetSimulation(bullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=client)
    bullet.setTimeStep(timestep, physicsClientId=client)
    bullet.setGravity(0.0, 0.0, -gravity, physicsClientId=client)
    return client


def disconnect(client: int) -> None:
    """Give a world back."""
    import pybullet as bullet

    with quiet():
        bullet.disconnect(physicsClientId=client)
