"""Compiling a robot's library, and the FMU as an archive."""

from __future__ import annotations

import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from importlib.metadata import distribution
from pathlib import Path
from uuid import uuid4

import mujoco

from engines.mujoco.export.fmu.description import FmiVersion, description
from engines.mujoco.export.fmu.robot import Robot
from engines.mujoco.export.fmu.tables import tables
from engines.mujoco.params import MujocoParams
from schemas.errors import ScenarioError

__all__ = ["FmiVersion", "write_fmu"]

_HERE = Path(__file__).parent
_IDENTIFIER = "dvrk"
_MODEL = "robot.mjb"
_FOLDERS = {
    ("2", "x86_64"): "linux64",
    ("3", "x86_64"): "x86_64-linux",
    ("3", "aarch64"): "aarch64-linux",
}
"""Folder of the binaries by FMI version and processor (FMI 2.0.4 section 2.3, FMI 3.0.2 section 2.5.1)."""
_FLAGS = (
    "-std=gnu11",
    "-O2",
    "-ffp-contract=off",
    "-fno-fast-math",
    "-fvisibility=hidden",
    "-shared",
    "-fPIC",
)
_ERRORS = 2000
"""Most characters of the compiler's errors in a message."""


def write_fmu(params: MujocoParams, path: Path, fmi: FmiVersion, period_ns: int) -> Robot:
    """Write the robot of `params`, stepped every `period_ns`, to `path` as an FMU for co-simulation.

    The library has the model inside, and MuJoCo's library beside it: the FMU needs neither Trocar nor Python.

    Raises ScenarioError where a scene has more than an FMU can, and for a machine without a C compiler or
    without a folder in FMI.
    """
    folder, compiler = _folder(fmi), shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        raise ScenarioError(
            "a robot's FMU is compiled from C, and there is no 'cc' here; install gcc or clang"
        )
    robot = Robot(params.model_copy(update={"looks": "none"}), period_ns)
    token = f"{{{uuid4()}}}"
    runtime = _runtime()
    with tempfile.TemporaryDirectory(prefix="trocar-fmu-") as scratch:
        library = _compile(compiler, robot, fmi, token, runtime, Path(scratch))
        path.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", description(robot, fmi, token, _IDENTIFIER))
            archive.write(library, f"binaries/{folder}/{library.name}")
            archive.write(runtime, f"binaries/{folder}/{runtime.name}")
            for name, text in _licenses().items():
                archive.writestr(f"documentation/licenses/{name}", text)
    return robot


def _folder(fmi: FmiVersion) -> str:
    machine = platform.machine()
    if sys.platform != "linux" or (fmi, machine) not in _FOLDERS:
        other = ", or choose --fmi 3" if fmi == "2" and ("3", machine) in _FOLDERS else ""
        machines = ", ".join(one for version, one in _FOLDERS if version == fmi)
        raise ScenarioError(
            f"FMI {fmi}.0 FMUs of the robot are made on Linux ({machines}), not on {sys.platform} {machine};"
            f" export it there{other}"
        )
    return _FOLDERS[fmi, machine]


def _runtime() -> Path:
    """Return MuJoCo's shared library."""
    return next(Path(mujoco.__file__).parent.glob("libmujoco.so.*"))


def _compile(compiler: str, robot: Robot, fmi: FmiVersion, token: str, runtime: Path, scratch: Path) -> Path:
    """Compile the library of `robot` in the folder `scratch`."""
    model = scratch / _MODEL
    mujoco.mj_saveModel(robot.model, str(model))
    (scratch / "tables.h").write_text(tables(robot, token, str(model), model.stat().st_size))
    library = scratch / f"{_IDENTIFIER}.so"
    found = subprocess.run(
        [
            compiler,
            *_FLAGS,
            f"-I{scratch}",
            f"-I{Path(mujoco.__file__).parent / 'include'}",
            *(str(_HERE / name) for name in ("robot.c", f"fmi{fmi}.c")),
            str(runtime),
            "-Wl,-rpath,$ORIGIN",
            "-lm",
            "-o",
            str(library),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    if found.returncode:
        raise ScenarioError(f"the robot's FMU cannot be compiled: {found.stderr.strip()[-_ERRORS:]}")
    return library


def _licenses() -> dict[str, str]:
    """Return the licenses of MuJoCo's library by file name: Apache 2.0 asks for a copy."""
    files = [file for file in distribution("mujoco").files or () if "licenses" in file.parts]
    return {f"mujoco-{file.name}": file.read_text(encoding="utf-8") for file in files}
