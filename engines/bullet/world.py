"""Worlds of Bullet; a process may have several side by side."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Generator
from contextlib import contextmanager

from engines.tissue.organs.anchors import RigidParams
from schemas.errors import MissingExtraError, SessionError

__all__ = ["COLLISION_MARGIN_M", "add_rigid", "connect", "disconnect", "quiet"]

COLLISION_MARGIN_M = 1e-4
"""Distance of first contact in Bullet; the spheres of probes are smaller by this distance."""


@contextmanager
def quiet(descriptor: int = 1) -> Generator[None]:
    """Discard Bullet's prints on a file descriptor: stdout (1), perhaps with JSON, or stderr (2).

    Bullet prints through C's buffers, so the buffers are flushed before the descriptor is restored.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    libc = ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None)
    saved = os.dup(descriptor)
    try:
        with open(os.devnull, "wb") as nowhere:  # noqa: PTH123  a device, not a file
            os.dup2(nowhere.fileno(), descriptor)
        yield
    finally:
        libc.fflush(None)
        os.dup2(saved, descriptor)
        os.close(saved)


def connect(part: str, timestep: float, gravity: float) -> int:
    """Return a new world of deformable bodies, stepped by `timestep` (s), with `gravity` (m/s^2) along -z.

    Raises MissingExtraError, naming `part`, where pybullet is not installed.
    """
    try:
        with quiet(2):  # on import it prints its build time
            import pybullet as bullet
    except ImportError as error:
        raise MissingExtraError(part, "bullet", "pybullet") from error
    with quiet():
        client = bullet.connect(bullet.DIRECT)
        if client < 0:
            raise SessionError(
                f"{part}: Bullet gave no physics client; it allows a limited number in one process, so spread"
                " the engines over hosts"
            )
        bullet.resetSimulation(bullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=client)
    bullet.setTimeStep(timestep, physicsClientId=client)
    # With split impulses, spheres sink twice as deep into faces of soft bodies.
    bullet.setPhysicsEngineParameter(useSplitImpulse=0, physicsClientId=client)
    bullet.setGravity(0.0, 0.0, -gravity, physicsClientId=client)
    return client


def add_rigid(params: RigidParams, client: int) -> int:
    """Add a rigid part to the world of `client`, and return its number in Bullet."""
    import pybullet as bullet

    shape = bullet.createCollisionShape(
        bullet.GEOM_BOX, halfExtents=[0.5 * edge for edge in params.box], physicsClientId=client
    )
    body = bullet.createMultiBody(
        0.0, shape, basePosition=params.position, baseOrientation=params.orientation, physicsClientId=client
    )
    bullet.changeDynamics(body, -1, lateralFriction=params.friction, physicsClientId=client)
    return body


def disconnect(client: int) -> None:
    """Close a world."""
    import pybullet as bullet

    with quiet():
        bullet.disconnect(physicsClientId=client)
