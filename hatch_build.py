"""Compiles the modules in C into the wheel, or beside their sources where the package is editable.

Without a C compiler the wheel is one of pure Python: its results are the same to the bit, it is slower, and
it has no engine `fem`.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from setuptools import Distribution, Extension
from setuptools.command.build_ext import build_ext
from setuptools.errors import BaseError, CCompilerError

# A product and a sum that become one instruction are rounded once instead of twice. MSVC does not fuse them.
_FLAGS = [] if sys.platform == "win32" else ["-ffp-contract=off", "-fno-fast-math", "-fvisibility=hidden"]
_EXTENSIONS = (
    Extension(
        "robots._kinematics",
        ["robots/_kinematics.c", "robots/_closed_form.c", "robots/_tips.c"],
        depends=["robots/_kinematics.h"],
        include_dirs=[np.get_include()],
        extra_compile_args=_FLAGS,
    ),
    Extension(
        "engines.fem._solid",
        [
            f"engines/fem/_{part}.c"
            for part in (
                *("solid", "step", "elements", "elements_avx", "elements_avx512", "contact", "rigid"),
                *("topology", "cut", "blade", "ties", "together", "touch", "pairs", "attach"),
            )
        ],
        depends=[
            "engines/fem/_solid.h",
            "engines/fem/_lanes.h",
            "engines/fem/_forces.h",
            "engines/fem/_pairs.h",
            "engines/fem/_triangle.h",
            "engines/fem/_vectors.h",
        ],
        extra_compile_args=[*_FLAGS, "/O2" if sys.platform == "win32" else "-O3"],
    ),
    Extension(
        "engines.fem._probe",
        ["engines/fem/_probe.c", "engines/fem/_near.c"],
        depends=["engines/fem/_near.h", "engines/fem/_triangle.h"],
        extra_compile_args=_FLAGS,
    ),
    Extension("engines.fem._heat", ["engines/fem/_heat.c"], extra_compile_args=_FLAGS),
    Extension("engines.fem._film", ["engines/fem/_film.c"], extra_compile_args=_FLAGS),
    Extension(
        "engines.fmu._calls",
        ["engines/fmu/_calls.c"],
        include_dirs=[np.get_include()],
        extra_compile_args=_FLAGS,
    ),
    Extension(
        "engines.mujoco.pictures.filament._exposure",
        ["engines/mujoco/pictures/filament/_exposure.c"],
        # a square root that may set errno is taken one by one
        extra_compile_args=[*_FLAGS, "/O2"]
        if sys.platform == "win32"
        else [*_FLAGS, "-O3", "-fno-math-errno"],
    ),
    Extension("schemas._cdr", ["schemas/_cdr.c"], include_dirs=[np.get_include()], extra_compile_args=_FLAGS),
)


class Compile(BuildHookInterface[Any]):
    """The step of the build that needs a compiler, and may fail."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        """Compile, and add what came of it to the wheel."""
        for extension in _EXTENSIONS:
            command = build_ext(Distribution({"ext_modules": [extension]}))
            command.inplace = True
            command.ensure_finalized()
            try:
                command.run()
            except (BaseError, CCompilerError) as error:
                self.app.display_warning(f"{extension.name} is left out, its Python is slower: {error}")
                continue
            name: str = command.get_ext_filename(extension.name)
            build_data["artifacts"].append(name)
            build_data["pure_python"], build_data["infer_tag"] = False, True
