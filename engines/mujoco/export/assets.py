"""Meshes of a model as Wavefront OBJ files."""

from __future__ import annotations

import mujoco
import numpy as np

__all__ = ["FOLDER", "file_of", "meshes", "numbers"]

FOLDER = "assets"
"""Beside the model's file."""


def numbers(values: object) -> str:
    """Return numbers as text with all bits."""
    return " ".join(repr(float(value)) for value in np.asarray(values, float).ravel())


def file_of(mesh: str) -> str:
    """Return the name of the file of the mesh called `mesh`."""
    return mesh.replace("/", "_") + ".obj"


def meshes(spec: mujoco.MjSpec) -> dict[str, str]:
    """Return the content of every mesh's file, by file name."""
    return {file_of(mesh.name): _to_obj(mesh) for mesh in spec.meshes}


def _to_obj(mesh: mujoco.MjsMesh) -> str:
    vertices, faces = np.reshape(mesh.uservert, (-1, 3)), np.reshape(mesh.userface, (-1, 3)) + 1
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in faces.tolist()]
    return "\n".join(lines) + "\n"
