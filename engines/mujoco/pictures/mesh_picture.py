"""A picture of a mesh: its faces, its named surfaces in colours, and a legend."""

from __future__ import annotations

from collections.abc import Mapping
from colorsys import hsv_to_rgb
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.camera_mount import look_at
from engines.mujoco.pictures.endoscope_params import ViewParams
from engines.mujoco.pictures.endoscope_scene import add_sky
from engines.mujoco.pictures.stereo import StereoRenderer
from robots.dvrk.endoscope import StereoCamera
from schemas.errors import TrocarError
from schemas.vectors import Vector

__all__ = ["draw_mesh"]

_ENUMS: Any = mujoco
_SHELL = _ENUMS.mjtMeshInertia.mjMESH_INERTIA_SHELL
"""Without it MuJoCo refuses meshes that are not closed; missing in its stubs."""
_PIXELS, _OVERSAMPLING, _FIELD_OF_VIEW = 480, 2, 0.6
_DIRECTIONS = (np.array([0.6, -0.7, 0.4]), np.array([-0.6, 0.7, -0.4]))
"""Where the two pictures look from."""
_DISTANCE = 1.7
"""Distance of the cameras, in diagonals of the mesh."""
_PLAIN = (0.78, 0.55, 0.5)
_GAP = 0.04
"""Share of a face left dark at its edges."""
_INK = "black"
_DARK, _BELOW = (0.2, 0.15, 0.15), 0.002
"""Colour of the edges; depth of the dark faces, in edges."""


def draw_mesh(
    file: Path,
    nodes: Vector,
    triangles: NDArray[np.int64],
    surfaces: Mapping[str, NDArray[np.bool_]],
    title: str,
) -> None:
    """Write a picture of a mesh from two sides.

    Args:
        file: .png to write.
        nodes: shape (n, 3), m.
        triangles: of the surface, shape (f, 3), counter-clockwise seen from outside.
        surfaces: nodes of each named surface, shape (n,); a face with all its nodes there has its colour.
        title: text above the legend.

    Raises TrocarError if nothing can be drawn on this machine.
    """
    gl = opengl.find()
    if not gl.name:
        raise TrocarError(f"no OpenGL works here ({gl.detail}). To fix it: {opengl.REMEDY}")
    colours = {name: hsv_to_rgb(i / max(len(surfaces), 1), 0.65, 0.9) for i, name in enumerate(surfaces)}
    group = np.full(len(triangles), -1)
    for i, picked in enumerate(surfaces.values()):
        group[picked[triangles].all(axis=1)] = i
    shades = [_PLAIN, *colours.values()]
    parts = [(nodes[triangles[group == i - 1]], shade) for i, shade in enumerate(shades)]
    pictures = _render(gl.name, nodes, [part for part in parts if len(part[0])])
    image = Image.fromarray(np.concatenate(pictures, axis=1))
    image = image.resize((2 * _PIXELS, _PIXELS), Image.Resampling.LANCZOS)
    _add_legend(image, title, colours)
    image.save(file)


def _render(
    gl: str, nodes: Vector, parts: list[tuple[Vector, tuple[float, float, float]]]
) -> list[NDArray[np.uint8]]:
    spec: Any = mujoco.MjSpec()
    add_sky(spec)
    spec.visual.headlight.ambient = [0.4, 0.4, 0.4]
    spec.visual.headlight.diffuse = [0.6, 0.6, 0.6]
    spec.visual.headlight.specular = [0.0, 0.0, 0.0]
    for i, (corners, shade) in enumerate(parts):
        middles = corners.mean(axis=1, keepdims=True)
        for name, points, colour in (
            ("face", corners + _GAP * (middles - corners), shade),
            ("edge", corners - _BELOW * _normals(corners), _DARK),
        ):
            _add_triangles(spec, f"{name} {i}", points, colour)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    middle = 0.5 * (nodes.min(axis=0) + nodes.max(axis=0))
    distance = _DISTANCE * float(np.linalg.norm(np.ptp(nodes, axis=0)))
    side = _OVERSAMPLING * _PIXELS
    camera = StereoCamera(side, side, _FIELD_OF_VIEW, 0.0)
    renderer = StereoRenderer(model, camera, (0.1 * distance, 3.0 * distance), gl, shadows=False)
    try:
        places = [middle + distance * direction for direction in _DIRECTIONS]
        views = [ViewParams(position=tuple(place), target=tuple(middle)) for place in places]
        return [renderer.render(data, look_at(view))[0] for view in views]
    finally:
        renderer.close()


def _normals(corners: Vector) -> Vector:
    """Return the unit normal of each face times its longest edge, shape (f, 1, 3), m."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return (normal * (length / np.linalg.norm(normal, axis=1))[:, None])[:, None]


def _add_triangles(spec: Any, name: str, corners: Vector, colour: tuple[float, float, float]) -> None:
    """Add faces, shape (f, 3, 3), m, each with vertices of its own, so that it looks flat."""
    flat = corners.reshape(-1, 3)
    spec.add_mesh(
        name=name,
        uservert=flat.ravel().tolist(),
        userface=np.arange(len(flat)).tolist(),
        inertia=_SHELL,
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, rgba=[*colour, 1.0], contype=0, conaffinity=0
    )


def _add_legend(image: Image.Image, title: str, colours: Mapping[str, tuple[float, float, float]]) -> None:
    draw, font, line = ImageDraw.Draw(image), ImageFont.load_default(14), 20
    draw.text((8, 6), title, _INK, font)
    for i, (name, colour) in enumerate(colours.items(), start=1):
        top = 6 + line * i
        draw.rectangle((8, top + 2, 20, top + 14), tuple(round(255 * c) for c in colour))
        draw.text((26, top), name, _INK, font)
