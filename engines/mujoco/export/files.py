"""Writing an exported model and its meshes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

import mujoco

from engines.mujoco.export.assets import FOLDER, meshes
from engines.mujoco.export.keyframe import add_start
from engines.mujoco.export.mjcf import mjcf
from engines.mujoco.export.urdf import urdf
from engines.mujoco.model import spec
from engines.mujoco.params import SceneParams

__all__ = ["FORMATS", "Format", "write"]

Format = Literal["mjcf", "urdf"]

_WRITERS: Mapping[Format, Callable[[mujoco.MjSpec], ElementTree.Element]] = {"mjcf": mjcf, "urdf": urdf}

FORMATS: Mapping[str, Format] = {".xml": "mjcf", ".mjcf": "mjcf", ".urdf": "urdf"}
"""By the suffix of the file."""


def write(scene: SceneParams, path: Path, form: Format) -> list[Path]:
    """Write the model of `scene` to `path` and its meshes to the folder `assets` beside it; return all files."""
    model = spec(scene)
    add_start(model, scene)
    root = _WRITERS[form](model)
    ElementTree.indent(root)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(ElementTree.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
    written = [path]
    for file, content in meshes(model).items():
        written.append(path.parent / FOLDER / file)
        written[-1].parent.mkdir(exist_ok=True)
        written[-1].write_text(content, encoding="ascii")
    return written
