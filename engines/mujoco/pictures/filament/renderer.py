"""Draws what two cameras side by side see of a MuJoCo model, with Filament."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import tan

import mujoco
import numpy as np
from mujoco import mjrf
from numpy.typing import NDArray

from engines.mujoco.markers.solids import Solid
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.filament.ambient import add_ambient
from engines.mujoco.pictures.filament.backend import Backend
from engines.mujoco.pictures.filament.drawn_body import DrawnBody
from engines.mujoco.pictures.filament.drawn_geoms import DrawnGeoms
from engines.mujoco.pictures.filament.drawn_place import DrawnPlace
from engines.mujoco.pictures.filament.drawn_solids import DrawnSolids
from engines.mujoco.pictures.filament.focus import Focus
from engines.mujoco.pictures.filament.lamp import Lamp, RoomLamp
from engines.mujoco.pictures.filament.light_control import LightControl
from engines.mujoco.pictures.filament.upload import take_held
from engines.mujoco.pictures.skin_params import body_recipes
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.pictures.variation import Variation
from engines.mujoco.place.part import PlacePart
from engines.mujoco.textures.atlas import picture_side
from engines.mujoco.textures.coats import changed_coats
from engines.mujoco.textures.noise import Noise
from robots.dvrk.endoscope import StereoCamera
from schemas.vectors import Vector

__all__ = ["FilamentRenderer"]

_SHADOW_PIXELS, _ROOM_SHADOW_PIXELS = 512, 1024
"""Side of a shadow map: of the lamp beside the lens, and of the lamp over a whole table."""
_SAMPLES = 4
_BACKGROUND = (0.42, 0.45, 0.48)
"""Colour where nothing is: an even room."""
_TRIES = 6
"""Most pictures until the light of the first one is right."""
_WHITE = 1.0, 1.0, 1.0
_WARM, _COLD = (1.25, 0.88, 0.79), (0.91, 1.035, 1.07)
"""Colour of light from all sides where tissue is all around, and factors of the lamp, so that both together
are nearly white: light that tissue has scattered is redder, so what turns away from the lamp, or lies in a
shadow, is warm.
"""
_AMBIENT: Mapping[str, tuple[float, tuple[float, float, float], tuple[float, float, float]]] = {
    "abdomen": (9_000.0, _WARM, _COLD),
    "subhepatic": (6_000.0, _WARM, _COLD),
    "dry-lab": (7_000.0, _WHITE, _WHITE),
    "none": (9_000.0, _WHITE, _WHITE),
}
"""Light from all sides by place: lux, its colour, and factors of the colour of the lamp."""


class FilamentRenderer:
    """Owns a context of the renderer, which belongs to the thread that made it."""

    def __init__(
        self,
        model: mujoco.MjModel,
        params: EndoscopeParams,
        variation: Variation,
        camera: StereoCamera,
        clip: tuple[float, float],
        backend: Backend,
        bodies: Mapping[str, SoftBody],
        place: Sequence[PlacePart],
        ahead: Vector,
    ) -> None:
        """Prepare to draw.

        Args:
            model: what to draw, made by `place.dress_scene`.
            params: sensor and looks of soft bodies.
            variation: random differences of colours and textures.
            camera: the two cameras.
            clip: near and far distance between which they see, m.
            backend: the graphics interface to use.
            bodies: soft bodies, drawn beside the model.
            place: surroundings.
            ahead: direction of the camera at the start, shape (3,).
        """
        self._camera = camera
        exposure = params.sensor.exposure + variation.exposure
        self._control = LightControl(exposure) if params.sensor.automatic_light else None
        self._is_lit = False
        skins = params.soft_bodies
        half = clip[0] * tan(0.5 * camera.field_of_view)
        self._frustum = half * camera.height / camera.width, *clip
        self._context = backend.context()
        self._context.set_clear_color(_BACKGROUND)
        self._scene = self._context.create_scene(mjrf.SceneParams())
        self._scene.configure_from_model(model)
        self._scene.set_msaa(_SAMPLES)
        self._resources = mjrf.ModelResources(self._context, model)
        noise = Noise(variation.texture_seed)
        self._geoms = DrawnGeoms(self._context, self._scene, model, noise)
        self._rigid = mjrf.ModelRenderables(self._scene, self._resources)
        options = mujoco.MjvOption()
        options.sitegroup[:] = 0
        self._rigid.set_options(options)
        is_room = params.surroundings == "dry-lab"
        pixels = _ROOM_SHADOW_PIXELS if is_room else _SHADOW_PIXELS
        if params.shadows is False:
            pixels = 0
        self._brightness, colour, factors = _AMBIENT[params.surroundings]
        lamp_colour = variation.lamp_colour * factors
        # shadows of two lamps would cost a fifth of a picture more
        self._lamp = Lamp(self._context, self._scene, 0 if is_room else pixels, lamp_colour)
        self._room_lamp = RoomLamp(self._context, self._scene, pixels, lamp_colour) if is_room else None
        self._ambient = add_ambient(self._context, self._scene, self._brightness, colour)
        recipes = body_recipes(skins, {name: body.rest for name, body in bodies.items()})
        self._bodies = [
            DrawnBody(
                self._context,
                self._scene,
                body,
                variation.recolour(recipes[name], name),
                changed_coats(skins[name].tissue(name)),
                noise,
                picture_side(len(bodies)),
            )
            for name, body in bodies.items()
        ]
        self._place = DrawnPlace(
            self._context,
            self._scene,
            place,
            noise,
            variation,
            None if is_room else ahead,  # a lamp far away has one shadow map over the bounds of all
        )
        self._solids = DrawnSolids(self._context, self._scene)
        # with a fourth byte: without it the driver's pixels are packed one by one, 7 ms for 2 x 640 x 480
        self._pixels = np.zeros((camera.height, 2 * camera.width, 4), np.uint8)
        self._target = self._context.create_render_target(
            mjrf.RenderTargetConfig(
                width=2 * camera.width,
                height=camera.height,
                color_format=mjrf.PixelFormat.PIXEL_FORMAT_RGBA8,
                depth_format=mjrf.PixelFormat.PIXEL_FORMAT_DEPTH32F,
            )
        )
        self._read = mjrf.ReadRequest(target=self._target)
        self._read.set_buffer(self._pixels)
        focus = params.sensor.focus
        self._focus = (
            None if focus is None else Focus(self._context, camera, clip, focus, params.sensor.aperture)
        )

    def render(
        self, data: mujoco.MjData, pose: Vector, solids: Sequence[Solid] = ()
    ) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return the pictures of the left and the right camera, each of shape (height, width, 3), RGB.

        The first row is the top. The next call draws into the same memory.

        Args:
            data: state whose kinematics are up to date.
            pose: the optical frame midway between the cameras, in the world, shape (4, 4).
            solids: to be drawn beside the model.
        """
        self._rigid.update(data)
        self._geoms.update(data)
        for body in self._bodies:
            body.update()
        self._solids.show(solids)
        self._lamp.aim(pose)
        width, height = self._camera.width, self._camera.height
        eyes = [self._eye(pose, side) for side in (-0.5, 0.5)]
        requests = [
            mjrf.RenderRequest(
                scene=self._scene,
                camera=camera,
                viewport=mjrf.Rect(left=eye * width, bottom=0, width=width, height=height),
                target=self._target,
            )
            for eye, camera in enumerate(eyes)
        ]
        left, right = self._pixels[:, :width, :3], self._pixels[:, width:, :3]
        for _ in range(1 if self._control is None or self._is_lit else _TRIES):
            self._context.wait_for_frame(self._context.render(requests, [self._read]))
            for uploaded in take_held(self._context):
                uploaded.free()
            if self._control is None or not self._adjust_light(self._control, left):
                break
        self._is_lit = True
        if self._focus is None:
            return left, right
        self._focus.measure(self._scene, eyes)
        return self._focus.blur(left, 0), self._focus.blur(right, 1)

    def _adjust_light(self, control: LightControl, picture: NDArray[np.uint8]) -> bool:
        """Dim the lamp by a picture; return whether the first picture needs another try."""
        is_far = control.follow(picture) if self._is_lit else control.follow(picture, 1.0)
        self._lamp.dim(control.factor)
        if self._room_lamp is not None:
            self._room_lamp.dim(control.factor)
        self._ambient[1].set_intensity(self._brightness * control.factor)
        return is_far and not self._is_lit

    def _eye(self, pose: Vector, side: float) -> mjrf.Camera:
        right, down, ahead, middle = pose[:3, :4].T.astype(np.float32)
        top, near, far = self._frustum
        return mjrf.Camera(
            pos=middle + np.float32(side * self._camera.baseline) * right,
            forward=ahead,
            up=-down,
            frustum_center=0.0,
            frustum_bottom=-top,
            frustum_top=top,
            frustum_near=near,
            frustum_far=far,
        )

    def close(self) -> None:
        """Free everything in the renderer's memory. May be called twice."""
        held = take_held(self._context) if self.__dict__ else ()
        # the newest attribute first and the context last: what is in a context must not outlive it
        while self.__dict__:
            self.__dict__.popitem()
        for data in held:  # of a scene that was never drawn
            data.free()
