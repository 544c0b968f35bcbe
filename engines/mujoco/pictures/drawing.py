"""What draws on this machine: OpenGL for plain looks, Filament for those of an endoscope."""

from __future__ import annotations

from dataclasses import dataclass

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.filament import backend
from engines.mujoco.pictures.filament.backend import Backend

__all__ = ["Drawing", "find_drawing"]


@dataclass(frozen=True)
class Drawing:
    """What was found."""

    engine: Backend | str
    """A graphics interface for Filament, or the name of an OpenGL; empty: nothing draws."""
    shortcoming: str
    """What is missing and how to mend it, as the end of a sentence about a participant; empty: nothing."""


def find_drawing(looks: str) -> Drawing:
    """Return what draws a scene with `looks`, as a scene's parameters state them."""
    shortcoming = ""
    if looks == "endoscope":
        found = backend.find()
        if found.name:
            return Drawing(found, "")
        shortcoming = (
            f"draws plain looks: Filament does not run here ({found.detail}). To fix it: {backend.REMEDY}"
        )
    gl = opengl.find()
    if not gl.name:
        shortcoming = f"publishes no pictures: no OpenGL works here ({gl.detail}). To fix it: {opengl.REMEDY}"
    return Drawing(gl.name, shortcoming)
