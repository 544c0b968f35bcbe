"""Writing an exported model with meshes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

import mujoco

from engines.mujoco.export.assets import FOLDER, meshes
from engines.mujoco.export.mjcf import mjcf
from engines.mujoco.export.urdf import urdf
from engines.mujoco.model import place, spec, ties
from engines.mujoco.params import SceneParams

__all__ = ["FORMATS", "START", "Format", "write"]

Format = Literal["mjcf", "urdf", "fmu"]

FORMATS: Mapping[str, Format] = {".xml": "mjcf", ".mjcf": "mjcf", ".urdf": "urdf", ".fmu": "fmu"}
"""Format by the suffix of the file."""

START = "start"
"""Name of the first keyframe of a loaded model."""


def write(scene: SceneParams, path: Path, form: Literal["mjcf", "urdf"]) -> list[Path]:
    """Write the model of `scene` to `path`, the meshes to the folder `assets` there; return all files.

    As in a session, fingers are tied, and the ECM has brakes, open; `active` closes the brakes, where the ECM
    starts.
    """
    model = spec(scene)
    ties.add(model, scene)
    if ties.BRAKED in scene.arms:
        arm = scene.arms[ties.BRAKED]
        for joint, position in zip(arm.chain.joints, arm.start, strict=True):
            ties.set_brake(model, joint.name, position)
    _add_start(model, scene)
    root = mjcf(model) if form == "mjcf" else urdf(model, scene.arms)
    ElementTree.indent(root)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(ElementTree.tostring(root, encoding="unicode") + "\n", encoding="utf-8")
    written = [path]
    for file, content in meshes(model).items():
        written.append(path.parent / FOLDER / file)
        written[-1].parent.mkdir(exist_ok=True)
        written[-1].write_text(content, encoding="ascii")
    return written


def _add_start(spec: mujoco.MjSpec, scene: SceneParams) -> None:
    """Add the keyframe `START`: joints at the scene's start, and goals of the servos there.

    Otherwise a loaded model would begin with instruments drawn back and servos pulling there.
    """
    model = spec.compile()
    data = mujoco.MjData(model)
    place(model, data, scene.arms)
    for actuator, (joint, _) in enumerate(model.actuator_trnid):
        data.ctrl[model.actuator_ctrladr[actuator]] = data.qpos[model.jnt_qposadr[joint]]
    spec.add_key(name=START, qpos=data.qpos, ctrl=data.ctrl)
