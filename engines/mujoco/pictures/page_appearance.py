"""The appearance of a scene for pages: the textures and surroundings of endoscope looks, as files."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from engines.mujoco.model import place as place_arms
from engines.mujoco.model import spec
from engines.mujoco.params import SceneParams
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.skin_params import SkinParams, body_recipes
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.pictures.surroundings import make_place
from engines.mujoco.place.dress import BRIGHT
from engines.mujoco.place.part import PlacePart
from engines.mujoco.textures.atlas import Atlas, picture_side
from engines.mujoco.textures.coats import COATS, KINDS, Coat
from engines.mujoco.textures.noise import SEED, Noise
from engines.mujoco.textures.surface import Maps, Recipe, make_tile
from hub.participant import appearance
from hub.participant.appearance import Appearance, RestBody, Skin, Surrounding, Texture
from robots.dvrk.endoscope import optical_in_roll
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from robots.transform import rigid_transform
from schemas.vectors import Vector

__all__ = ["page_appearance"]

_QUALITY = 90
"""Quality of JPEG files: fine noise stays."""
_PLACE_PIXELS = 512
_BRIGHT = Coat(COATS["steel"].recipe, COATS["steel"].tile, 1.0)
"""Coat of a needle."""


def page_appearance(params: SceneParams, bodies: Mapping[str, RestBody]) -> Appearance:
    """Return the appearance of a scene with soft bodies at rest, by name.

    The textures of a body are those of its look in `params`, else of the tissue whose name ends its name.
    """
    noise, seen = Noise(SEED), _endoscope_params(params, bodies)
    recipes = body_recipes(seen.soft_bodies, {name: body.nodes for name, body in bodies.items()})
    return Appearance(
        {name: _skin(body, recipes[name], noise, picture_side(len(bodies))) for name, body in bodies.items()},
        {kind: _coat(coat, noise) for kind, coat in KINDS.items()},
        {name: _coat(coat, noise) for name, coat in {**COATS, BRIGHT: _BRIGHT}.items()},
        _surroundings(seen, bodies, noise),
        seen.surroundings,
        seen.sensor.vignette,
    )


def _endoscope_params(params: SceneParams, bodies: Mapping[str, RestBody]) -> EndoscopeParams:
    """Return the parameters of the endoscope, or of one that looks at the scene of a robot and all bodies."""
    if isinstance(params, EndoscopeParams):
        return params
    scene = {name: getattr(params, name) for name in SceneParams.model_fields}
    return EndoscopeParams.model_construct(**scene, skins={name: SkinParams() for name in bodies})


def _skin(body: RestBody, recipe: Recipe, noise: Noise, side: int) -> Skin:
    rest, faces = body.nodes.astype(np.float64), body.faces.astype(np.int64)
    atlas = Atlas(rest, faces, side)
    uv = atlas.uv(rest[faces].reshape(-1, 3), atlas.chart.repeat(3))
    return Skin(_texture(atlas.paint(recipe, noise)), uv.reshape(-1, 3, 2), atlas.chart.astype(np.uint16))


def _coat(coat: Coat, noise: Noise) -> appearance.Coat:
    return appearance.Coat(_texture(coat.maps(noise)), coat.tile, coat.metal)


def _surroundings(
    params: EndoscopeParams, bodies: Mapping[str, RestBody], noise: Noise
) -> tuple[Surrounding, ...]:
    model = spec(params).compile()
    soft: dict[str, SoftBody] = {}
    for name, body in bodies.items():
        soft[name] = SoftBody(name)
        soft[name].rest = body.nodes
    parts = make_place(params, model, soft, _lens(params, model))
    made: dict[Recipe, Texture] = {}
    for part in parts:
        if part.recipe not in made:
            made[part.recipe] = _texture(make_tile(part.recipe, noise, part.tile, _PLACE_PIXELS))
    return tuple(_surrounding(part, made[part.recipe]) for part in parts)


def _surrounding(part: PlacePart, texture: Texture) -> Surrounding:
    return Surrounding(part.vertices.astype(np.float32), part.faces.astype(np.uint32), part.uv, texture)


def _lens(params: EndoscopeParams, model: mujoco.MjModel) -> Vector:
    """Return where the endoscope of the robot is at the start, shape (3,), m; without one the origin."""
    ecm = params.arms.get("ECM")
    if not isinstance(ecm, MountedEcm):
        return np.zeros(3)
    data = mujoco.MjData(model)
    place_arms(model, data, params.arms)
    mujoco.mj_kinematics(model, data)
    roll = model.body("ECM/roll").id
    carrier = rigid_transform(data.xmat[roll].reshape(3, 3), data.xpos[roll])
    return (carrier @ optical_in_roll(ecm.endoscope))[:3, 3]


def _texture(maps: Maps) -> Texture:
    return Texture(_jpeg(maps.colour), _jpeg(maps.normal), _jpeg(maps.orm[..., 1]))


def _jpeg(pixels: NDArray[np.uint8]) -> bytes:
    file = BytesIO()
    # without subsampling: red and green of a normal are as fine as its blue
    Image.fromarray(np.ascontiguousarray(pixels)).save(file, "jpeg", quality=_QUALITY, subsampling=0)
    return file.getvalue()
