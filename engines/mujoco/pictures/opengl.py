"""Which OpenGL draws without a screen on this machine.

A process can try only one: PyOpenGL and MuJoCo choose it at the first use. So each is tried in a process of
its own; then this process also survives a driver that crashes. `MUJOCO_GL`, if it is set, decides
(https://mujoco.readthedocs.io/en/stable/programming).
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any

__all__ = ["REMEDY", "OpenGL", "check", "context", "find", "import_mujoco"]

REMEDY = "apt-get install libosmesa6 (draws on the CPU), or libegl1 and the driver of the GPU"

_CANDIDATES = {"linux": ("egl", "osmesa"), "darwin": ("cgl",)}
"""OpenGL variants by `sys.platform`, best first; elsewhere GLFW's hidden window."""
_OFF = ("disable", "disabled", "off", "false", "0")
"""Values of MUJOCO_GL that forbid OpenGL, as `mujoco.rendering.classic.gl_context` has them."""
_SCREEN = ("glfw", "glx", "wgl", "enable", "enabled", "on", "true", "1")
"""Values of MUJOCO_GL that mean GLFW (same source)."""
_PATIENCE_S = 60.0
"""A driver that has drawn nothing by then will not draw."""


@dataclass(frozen=True)
class OpenGL:
    """What `find` found.

    `name` is the value of MUJOCO_GL that works, empty if none does; `detail` the name of the renderer, or the
    error.
    """

    name: str
    detail: str


@cache
def find() -> OpenGL:
    """Return the first OpenGL that works here."""
    asked = os.environ.get("MUJOCO_GL", "").strip().lower()
    if asked in _OFF:
        return OpenGL("", f"MUJOCO_GL={asked} forbids it")
    tried: list[str] = []
    for name in (asked,) if asked else _CANDIDATES.get(sys.platform, ("glfw",)):
        works, detail = _try(name)
        if works:
            return OpenGL(name, detail)
        tried.append(f"{name}: {detail}")
    return OpenGL("", "; ".join(tried))


def _try(name: str) -> tuple[bool, str]:
    environment = {key: value for key, value in os.environ.items() if key != "PYOPENGL_PLATFORM"} | {
        "MUJOCO_GL": name
    }
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-m", __name__, name],
            env=environment,
            capture_output=True,
            text=True,
            timeout=_PATIENCE_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False, f"nothing drawn within {_PATIENCE_S:g} s"
    if done.returncode == 0:
        return True, done.stdout.strip()
    return False, (done.stderr.strip().splitlines() or [f"the process ended with {done.returncode}"])[-1]


def import_mujoco() -> None:
    """Import MuJoCo, also where MUJOCO_GL names an OpenGL that this machine does not have.

    Physics needs no OpenGL, but MuJoCo's package loads the one that is named, and fails with whatever the
    loader of the OpenGL library raises.
    """
    try:
        import_module("mujoco")
    except (AttributeError, ImportError, OSError, RuntimeError):
        asked = os.environ.pop("MUJOCO_GL", None)
        if asked is None:
            raise
        try:
            import_module("mujoco")
        finally:
            os.environ["MUJOCO_GL"] = asked


def context(name: str, width: int, height: int) -> Any:
    """Return a `GLContext` of MuJoCo, with `make_current` and `free`.

    `name`: the OpenGL to use, by its name in MUJOCO_GL.
    """
    # it reports that an optional package is not there
    logging.getLogger("OpenGL.acceleratesupport").setLevel(logging.WARNING)
    os.environ["MUJOCO_GL"] = name  # MuJoCo's library asks it where OpenGL's functions are
    return import_module(f"mujoco.{'glfw' if name in _SCREEN else name}").GLContext(width, height)


def check() -> tuple[bool, str, str]:
    """Return whether cameras work on this machine, what was found, and the remedy, for `trocar doctor`."""
    if find_spec("mujoco") is None:
        return False, "not tried: mujoco is not installed", "pip install 'trocar[mujoco]'"
    found = find()
    return bool(found.name), f"{found.name}, {found.detail}" if found.name else found.detail, REMEDY


def _draw(name: str) -> None:
    """Make a context as a renderer does, and write the name of what draws in it to the standard output."""
    import mujoco

    gl = context(name, 16, 16)
    gl.make_current()
    drawing = mujoco.MjrContext(
        mujoco.MjModel.from_xml_string("<mujoco/>"), mujoco.mjtFontScale.mjFONTSCALE_50
    )
    renderer: Any = import_module("OpenGL.GL")
    sys.stdout.write(renderer.glGetString(renderer.GL_RENDERER).decode())
    drawing.free()
    gl.free()


if __name__ == "__main__":
    _draw(sys.argv[1])
