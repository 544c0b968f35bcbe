"""Whether Filament draws on this machine, and through which graphics interface.

A renderer without a driver aborts its process instead of reporting an error, so each interface is tried in a
process of its own.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mujoco import mjrf

__all__ = ["REMEDY", "Backend", "check", "find"]

_DRIVER = re.compile(r"^Vulkan device driver: (.+)$", re.MULTILINE)
"""Filament's line on its standard output: `llvmpipe Mesa 25.0.7 (LLVM 15.0.6)`."""

_SLOW_DRIVER = re.compile(r"^llvmpipe Mesa (1\d|2[0-2])\.")
"""Mesa on the CPU, slower than Mesa 25 (decision 167); versions 23 and 24 were not measured."""

REMEDY = "apt-get install mesa-vulkan-drivers libvulkan1 (draws on the CPU), or the Vulkan driver of the GPU"

_PATIENCE_S = 120.0
"""Time to the first picture, with all shaders compiled, on a machine busy with other work."""


@dataclass(frozen=True)
class Backend:
    """What `find` found."""

    name: str
    """`vulkan` or `opengl`; empty if neither works."""
    software: bool
    """Whether it draws on the CPU by request."""
    detail: str
    """The driver, empty where Filament does not tell it; the errors, if neither works."""

    def context(self) -> mjrf.Context:
        """Return a context of the renderer."""
        with _quiet_output():
            return _create_context(self.name, software=self.software)


def _create_context(name: str, *, software: bool) -> mjrf.Context:
    from mujoco import mjrf

    import_module("mujoco.studio.window")  # registers the renderer's own files
    api = mjrf.GraphicsApi
    return mjrf.Context(
        mjrf.ContextConfig(
            graphics_api=api.GRAPHICS_API_VULKAN if name == "vulkan" else api.GRAPHICS_API_OPENGL,
            software_rendering=software,
        )
    )


@contextmanager
def _quiet_output() -> Generator[None]:
    """Drop the standard output, to which the renderer writes the driver that it has found."""
    sys.stdout.flush()
    kept, nothing = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nothing)


@cache
def find() -> Backend:
    """Return the first interface that works here: of a GPU, then on the CPU, then of a display."""
    if find_spec("mujoco") is None:
        return Backend("", False, "mujoco is not installed")
    candidates = [("vulkan", False), ("vulkan", True)]
    if os.environ.get("DISPLAY"):
        candidates.append(("opengl", False))
    tried: list[str] = []
    for name, software in candidates:
        works, detail = _try(name, software=software)
        if works:
            return Backend(name, software, detail)
        tried.append(f"{name}{' on the CPU' if software else ''}: {detail}")
    return Backend("", False, "; ".join(tried))


def _try(name: str, *, software: bool) -> tuple[bool, str]:
    """Return whether an interface works here, and its driver or the error."""
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-m", __name__, name, str(int(software))],
            capture_output=True,
            text=True,
            timeout=_PATIENCE_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False, f"nothing drawn within {_PATIENCE_S:g} s"
    if done.returncode == 0:
        driver = _DRIVER.search(done.stdout)
        return True, driver[1] if driver else ""
    return False, (done.stderr.strip().splitlines() or [f"the process ended with {done.returncode}"])[-1]


def check() -> tuple[bool, str, str]:
    """Return whether endoscope looks work on this machine, what was found, and the remedy."""
    if find_spec("mujoco") is None:
        return False, "not tried: mujoco is not installed", "pip install 'trocar[mujoco]'"
    found = find()
    if not found.name:
        return False, found.detail, REMEDY
    detail = f"Filament with {found.name}{' on the CPU' if found.software else ''}"
    if found.detail:
        detail += f": {found.detail}"
    if _SLOW_DRIVER.match(found.detail):
        detail += "; Mesa 25 draws 1.6 times as fast (docs/how-to/pictures.md)"
    return True, detail, REMEDY


def _draw(name: str, *, software: bool) -> None:
    """Draw an empty scene; the renderer writes its driver to the standard output."""
    import numpy as np
    from mujoco import mjrf

    context = _create_context(name, software=software)
    scene = context.create_scene(mjrf.SceneParams())
    target = context.create_render_target(
        mjrf.RenderTargetConfig(width=16, height=16, color_format=mjrf.PixelFormat.PIXEL_FORMAT_RGB8)
    )
    read = mjrf.ReadRequest(target=target)
    read.set_buffer(np.zeros((16, 16, 3), np.uint8))
    whole = mjrf.Rect(left=0, bottom=0, width=16, height=16)
    camera = mjrf.Camera(
        pos=(0.0, 0.0, 0.0),
        forward=(0.0, 0.0, -1.0),
        up=(0.0, 1.0, 0.0),
        frustum_center=0.0,
        frustum_bottom=-0.01,
        frustum_top=0.01,
        frustum_near=0.02,
        frustum_far=1.0,
    )
    request = mjrf.RenderRequest(scene=scene, camera=camera, target=target, viewport=whole)
    context.wait_for_frame(context.render([request], [read]))


if __name__ == "__main__":
    _draw(sys.argv[1], software=sys.argv[2] == "1")
