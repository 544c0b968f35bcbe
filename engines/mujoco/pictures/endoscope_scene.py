"""What the endoscope sees: the model of its scene, the state it receives, and the poses of its cameras."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco.markers.frames import SceneFrames
from engines.mujoco.markers.solids import Shape, extents, solids
from engines.mujoco.markers.store import ShownMarker
from engines.mujoco.model import place as place_arms
from engines.mujoco.model import spec
from engines.mujoco.pictures.camera_mount import CameraMount
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.filament.backend import Backend
from engines.mujoco.pictures.lens import Lens
from engines.mujoco.pictures.skins import Skins
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.pictures.stereo import StereoRenderer
from engines.mujoco.pictures.variation import Variation
from engines.mujoco.place.dress import dress_scene
from robots import rotation
from schemas.vectors import Vector

if TYPE_CHECKING:
    from engines.mujoco.pictures.filament.renderer import FilamentRenderer
    from engines.mujoco.pictures.filament.sensor import Sensor

__all__ = ["EndoscopeScene", "add_sky"]

_SKY, _GROUND = [0.75, 0.8, 0.85], [0.35, 0.37, 0.4]
"""Behind everything seen from a room, above and below; an endoscope sees only what its own lamp lights."""
_FLOOR, _FLOOR_M, _BELOW_M = "floor", 0.5, 0.5e-3
"""Name, half the side and distance below the soft bodies, m, of the floor in plain looks."""
_SQUARES, _SQUARES_PER_M = ([0.62, 0.67, 0.68], [0.56, 0.61, 0.62]), 100.0

_TONES = {"filmic": "filmic", "linear": "linear"}
"""Filament's names of tone mappings."""


class EndoscopeScene:
    """The model of the scene, its state, and the cameras in it."""

    def __init__(
        self,
        params: EndoscopeParams,
        engine: Backend | str,
        bodies: Mapping[str, SoftBody] = MappingProxyType({}),
    ) -> None:
        """Build the scene with the soft `bodies`, and prepare to draw it.

        `engine`: what draws, as `find_drawing` returns it: for Filament, or the name of an OpenGL.
        """
        scene = spec(params)
        self._variation = Variation(params.randomise)
        self._skins: Skins | None = None
        if isinstance(engine, Backend):
            exposure = params.sensor.exposure + self._variation.exposure
            smoke = min(params.smoke + self._variation.smoke, 1.0)
            printed = [name for name, fixture in params.fixtures.items() if fixture.kind == "disc-box"]
            dress_scene(scene, exposure, _TONES[params.sensor.tone], smoke, printed)
        else:
            if params.view is not None or "ECM" not in params.arms:
                add_sky(scene)
                if params.surroundings == "abdomen":
                    _add_floor(scene, bodies)
            self._skins = Skins(scene, bodies, params.soft_bodies)
        self._model = scene.compile()
        self._data = mujoco.MjData(self._model)
        self._frames = SceneFrames(params, self._model)
        self._mount = CameraMount(params, self._model)
        clip = self._mount.clip
        self._lens = Lens(params.camera, params.distortion)
        self._sensor: Sensor | None = None
        self._renderer = (
            self._filament(params, clip, engine, bodies)
            if isinstance(engine, Backend)
            else StereoRenderer(self._model, self._lens.drawn, clip, engine, shadows=bool(params.shadows))
        )

    def _filament(
        self,
        params: EndoscopeParams,
        clip: tuple[float, float],
        backend: Backend,
        bodies: Mapping[str, SoftBody],
    ) -> FilamentRenderer:
        from engines.mujoco.pictures.filament.renderer import FilamentRenderer
        from engines.mujoco.pictures.filament.sensor import Sensor
        from engines.mujoco.pictures.surroundings import make_place

        self._sensor = Sensor(params.sensor, params.width, params.height)
        place_arms(self._model, self._data, params.arms)
        mujoco.mj_kinematics(self._model, self._data)
        pose = self._mount.pose(self._data)
        place = make_place(params, self._model, bodies, pose[:3, 3], self._variation.place_seed)
        return FilamentRenderer(
            self._model,
            params,
            self._variation,
            self._lens.drawn,
            clip,
            backend,
            bodies,
            place,
            pose[:3, 2],
        )

    def draw(
        self, positions: Vector, markers: Sequence[ShownMarker] = (), time_ns: int = 0
    ) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return both pictures, shape (height, width, 3), RGB.

        Args:
            positions: of the joints, shape (nq,).
            markers: to be drawn.
            time_ns: simulated time, by which noise and what is on the lens differ.
        """
        model, data = self._model, self._data
        data.qpos[:] = positions
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_camlight(model, data)
        if self._skins is not None:
            self._skins.show(model, data)
        pose = self._mount.pose(data)
        shapes = [
            solid
            for marker in markers
            for solid in solids(marker, lambda frame: self._frames.pose(frame, data), pose, self._shapes)
        ]
        left, right = (self._lens.distort(drawn) for drawn in self._renderer.render(data, pose, shapes))
        if self._sensor is None:
            return left, right
        return self._sensor.expose(left, time_ns, 0), self._sensor.expose(right, time_ns, 1)

    @property
    def lens(self) -> Vector:
        """Place midway between the cameras at the state drawn last, shape (3,), m, in the world."""
        return self._mount.pose(self._data)[:3, 3]

    def _shapes(self, thing: str) -> list[Shape]:
        """Return the shapes of an object that can be seen and are no meshes, in its frame."""
        model, body = self._model, self._model.body(thing)
        return [
            Shape(
                int(model.geom_type[geom]),
                extents(int(model.geom_type[geom]), model.geom_size[geom]),
                model.geom_pos[geom],
                rotation.matrix(np.roll(model.geom_quat[geom], -1)),
            )
            for geom in range(int(body.geomadr[0]), int(body.geomadr[0] + body.geomnum[0]))
            if model.geom_rgba[geom, 3] > 0.0 and model.geom_dataid[geom] < 0
        ]

    def close(self) -> None:
        """Free the OpenGL context."""
        self._renderer.close()


def add_sky(scene: mujoco.MjSpec) -> None:
    """Add a bright background, as of a room."""
    scene.add_texture(
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=_SKY,
        rgb2=_GROUND,
        width=64,
        height=6 * 64,
    )


def _add_floor(scene: mujoco.MjSpec, bodies: Mapping[str, SoftBody]) -> None:
    """Add a floor with squares of 10 mm under the soft bodies: what lies on nothing seems to float."""
    lowest = min((float(body.rest[:, 2].min()) for body in bodies.values() if len(body.rest)), default=None)
    if lowest is None:
        return
    scene.add_texture(
        name=_FLOOR,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=_SQUARES[0],
        rgb2=_SQUARES[1],
        width=64,
        height=64,
    )
    material = scene.add_material(name=_FLOOR, texuniform=True, texrepeat=[_SQUARES_PER_M] * 2)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = _FLOOR
    scene.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[_FLOOR_M, _FLOOR_M, 0.1],
        pos=[0.0, 0.0, lowest - _BELOW_M],
        material=_FLOOR,
        contype=0,
        conaffinity=0,
    )
