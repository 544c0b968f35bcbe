"""The stereo endoscope: draws the scene at the joint positions it receives, at a period of its own.

A picture of the state at `t` comes out at the end of the step that begins there, stamped `t`, as a camera
delivers a frame one period after it was exposed (docs/decisions/0013).
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from io import BytesIO
from typing import TYPE_CHECKING, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.markers.store import shown_markers
from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.drawing import Drawing, find_drawing
from engines.mujoco.pictures.enclosure import enclosing_bodies
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.lens import NO_DISTORTION, Distortion
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.ports import position_count
from hub.participant import Inputs, Outputs, Params, Setup, Stepped, event_out, signal_in, state_hash
from robots.dvrk.endoscope import EYES, Eye, StereoCamera
from schemas.codec import decode, encode
from schemas.crtk import StringStamped
from schemas.errors import MessageError, MissingExtraError, StateError
from schemas.message import Message
from schemas.ports import Port
from schemas.ros import CameraInfo, CompressedImage, Header, Image, Time
from schemas.trocar_msgs import ShownMarkers, SoftBodyState, SurfaceChange, SurfaceFilm
from schemas.vectors import Vector

if TYPE_CHECKING:
    from engines.mujoco.pictures.endoscope_scene import EndoscopeScene
    from engines.mujoco.truth.camera_truth import CameraTruth

__all__ = ["Endoscope", "camera_info"]

_log = logging.getLogger(__name__)


class Endoscope(Stepped):
    """Two cameras at the tip of the ECM, or where the scenario puts them."""

    params_model: ClassVar[type[Params]] = EndoscopeParams
    params: EndoscopeParams
    observer: ClassVar[bool] = True

    def __init__(self, name: str, params: EndoscopeParams) -> None:
        super().__init__(name, params)
        self._positions = np.zeros(position_count(params))
        self._bodies = {organ: SoftBody(f"{organ}/nodes") for organ in params.soft_bodies}
        self._shown: ShownMarkers | None = None
        self._frame = f"{name}_left_optical"
        kinds: dict[str, type[Message]] = {} if params.images == "none" else {"camera_info": CameraInfo}
        if params.images in ("raw", "both"):
            kinds["image_raw"] = Image
        if params.images in ("compressed", "both"):
            kinds["image_raw/compressed"] = CompressedImage
        if kinds:
            kinds |= {name: StringStamped if name == "keypoints" else Image for name in params.truth}
        self._pictures = tuple(
            event_out(f"{eye}/{kind}", model, frame=self._frame)
            for eye in EYES
            for kind, model in kinds.items()
        )
        self._scene: EndoscopeScene | None = None
        self._truth: CameraTruth | None = None
        self._drawing = Drawing("", "")
        self._entered: set[str] = set()

    @property
    def ports(self) -> tuple[Port, ...]:
        """`qpos` of the same scene and the nodes of soft bodies in; per eye, pictures and calibration out.

        The outputs have ROS's names. Pictures are events: the first is published at the first step, and none
        on a machine without OpenGL.
        """
        positions = "joint positions of the scene, as the mujoco engine publishes them"
        nodes = "positions of the nodes of a soft body; the first message brings its surface"
        shown = "all markers to draw, as a participant of kind `markers` publishes them"
        qpos = signal_in("qpos", description=positions, size=self._positions.size)
        changed = "difference of the surface from that of the first message; may be left unconnected"
        wet = "liquid on the surface; may be left unconnected"
        bodies = (
            port
            for organ in self._bodies
            for port in (
                signal_in(f"{organ}/nodes", SoftBodyState, nodes, frame="world"),
                signal_in(f"{organ}/surface", SurfaceChange, changed, frame="world", start=()),
                signal_in(f"{organ}/film", SurfaceFilm, wet, frame="world", start=()),
            )
        )
        markers = signal_in("markers", ShownMarkers, shown, frame="world")
        return (qpos, *bodies, *((markers,) if self.params.markers else ()), *self._pictures)

    def configure(self, setup: Setup) -> Outputs:
        """Build the scene, unless soft bodies are missing from it.

        Without OpenGL it logs one warning and publishes no pictures; without Filament it logs one and draws
        plain looks.
        """
        for organ, body in self._bodies.items():
            body.may_change = f"{organ}/surface" in setup.connected
            body.may_be_wet = body.may_change and f"{organ}/film" in setup.connected
        if not self._pictures:
            return {}
        for package in ("mujoco", "PIL"):
            if find_spec(package) is None:
                raise MissingExtraError(
                    f"participant '{self.name}' (kind endoscope)",
                    "mujoco",
                    "pillow" if package == "PIL" else package,
                )
        opengl.import_mujoco()
        self._drawing = find_drawing(self.params.looks)
        if self._drawing.shortcoming:
            _log.warning("participant '%s' %s", self.name, self._drawing.shortcoming)
        elif self.params.truth and not opengl.find().name:
            _log.warning(
                "participant '%s' publishes no truth: no OpenGL works here. To fix it: %s",
                self.name,
                opengl.REMEDY,
            )
        if self._drawing.engine and not self._bodies:
            self._build_scene()
        return self._outputs({})

    def _build_scene(self) -> EndoscopeScene:
        from engines.mujoco.pictures.endoscope_scene import EndoscopeScene

        self._scene = EndoscopeScene(self.params, self._drawing.engine, self._bodies)
        if self.params.truth and opengl.find().name:
            from engines.mujoco.truth.camera_truth import CameraTruth

            self._truth = CameraTruth(self.params, self._bodies)
        return self._scene

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Draw the state at `t`.

        Raises SessionError if a soft body is not what it was, or its surface unknown.
        """
        self._positions[:] = inputs["qpos"]
        for organ, body in self._bodies.items():
            change = inputs.message(f"{organ}/surface") if body.may_change else None
            film = inputs.message(f"{organ}/film") if body.may_be_wet else None
            body.accept(inputs.message(f"{organ}/nodes"), change, film)
        if self.params.markers:
            self._shown = cast("ShownMarkers | None", inputs.message("markers"))
        if not self._drawing.engine:
            return self._outputs({})
        scene = self._scene or self._build_scene()
        header = Header(stamp=Time.from_ns(t), frame_id=self._frame)
        markers = () if self._shown is None else tuple(shown_markers(self._shown))
        pictures = scene.draw(self._positions, markers, t)
        self._warn_inside(scene.lens, t)
        messages = {
            f"{eye}/{name}": message
            for eye, pixels in zip(EYES, pictures, strict=True)
            for name, message in self._messages(eye, pixels, header)
        }
        if self._truth is not None:
            messages |= dict(self._truth.messages(self._positions, header))
        return self._outputs(messages)

    def _warn_inside(self, lens: Vector, t: int) -> None:
        """Log a warning, once for each soft body, if the cameras are inside; `lens`: shape (3,), m."""
        for organ in enclosing_bodies(lens, self._bodies):
            if organ not in self._entered:
                self._entered.add(organ)
                _log.warning(
                    "participant '%s': at %.3f s the camera is inside '%s' and sees nothing else; move the"
                    " endoscope, or its `view`, out of the tissue",
                    self.name,
                    t * 1e-9,
                    organ,
                )

    def _messages(self, eye: Eye, pixels: NDArray[np.uint8], header: Header) -> Iterator[tuple[str, Message]]:
        params = self.params
        yield "camera_info", camera_info(params.camera, eye, header, params.distortion)
        if params.images != "compressed":
            yield (
                "image_raw",
                Image(
                    header=header,
                    height=params.height,
                    width=params.width,
                    encoding="rgb8",
                    step=3 * params.width,
                    data=pixels.reshape(-1),
                ),
            )
        if params.images != "raw":
            yield (
                "image_raw/compressed",
                CompressedImage(header=header, format=params.format, data=self._compress_picture(pixels)),
            )

    def _outputs(self, messages: Mapping[str, Message]) -> Outputs:
        names = (port.name for port in self._pictures)
        return {name: (messages[name],) if name in messages else () for name in names}

    def _compress_picture(self, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        from PIL import Image as Picture

        file = BytesIO()
        # PNG is lossless at every level; the lowest is several times as fast for a little more length.
        options = {"quality": self.params.quality} if self.params.format == "jpeg" else {"compress_level": 1}
        Picture.fromarray(pixels).save(file, self.params.format, **options)
        return np.frombuffer(file.getvalue(), np.uint8)

    def state_hash(self) -> int:
        """Return the hash of the positions, nodes and markers drawn last.

        Pixels are left out, since two machines need not draw the same ones.
        """
        return state_hash(self.save())

    def save(self) -> bytes:
        """Return the positions last drawn, the state of the soft bodies, and the markers."""
        bodies = b"".join(body.save() for body in self._bodies.values())
        markers = b"" if self._shown is None else encode(self._shown)
        return self._positions.tobytes() + bodies + markers

    def restore(self, state: bytes) -> None:
        """Return to a saved state. Raises StateError if it does not fit this scene."""
        size, rest = self._positions.nbytes, state[self._positions.nbytes :]
        for body in self._bodies.values():
            rest = body.restore(rest)
        shown = None
        if self.params.markers and rest:
            shown, rest = self._restored_markers(rest), b""
        if len(state) < size or rest:
            raise StateError(
                f"participant '{self.name}': a saved state of {len(state)} bytes does not fit; was it saved"
                " by another scene?"
            )
        self._positions[:] = np.frombuffer(state, np.float64, self._positions.size)
        self._shown = shown
        if self._bodies:
            self.close()  # their surfaces may be others

    def _restored_markers(self, state: bytes) -> ShownMarkers:
        try:
            return decode(ShownMarkers, state)
        except MessageError as error:
            raise StateError(
                f"participant '{self.name}': a saved state with markers that cannot be read: {error}"
            ) from error

    def close(self) -> None:
        """Free the OpenGL contexts."""
        for scene in (self._scene, self._truth):
            if scene is not None:
                scene.close()
        self._scene = self._truth = None


def camera_info(
    camera: StereoCamera, eye: Eye, header: Header, distortion: Distortion = NO_DISTORTION
) -> CameraInfo:
    """Return the calibration of one camera of a rectified stereo pair, in the left camera's optical frame."""
    return CameraInfo(
        header=header,
        height=camera.height,
        width=camera.width,
        distortion_model="plumb_bob",
        d=np.array(distortion),
        k=camera.intrinsics().reshape(-1),
        r=np.eye(3).reshape(-1),
        p=camera.projection(eye).reshape(-1),
    )
