"""The stereo endoscope: draws the scene at the joint positions it receives, at a period of its own.

A picture of the state at `t` comes out at the end of the step that begins there, stamped `t`, as a camera
delivers a frame one period after it was exposed (docs/decisions/0013).
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from io import BytesIO
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.drawing import Drawing, find_drawing
from engines.mujoco.pictures.enclosure import enclosing_bodies
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.filament.backend import Backend
from engines.mujoco.pictures.lens import NO_DISTORTION, Distortion
from engines.mujoco.pictures.scene_apart import DrawingLostError, SceneApart
from engines.mujoco.pictures.seen_state import SeenState
from hub.participant import Inputs, Outputs, Params, Setup, Stepped, event_out, signal_in, state_hash
from robots.dvrk.endoscope import EYES, Eye, StereoCamera
from schemas.crtk import StringStamped
from schemas.errors import MissingExtraError, StateError
from schemas.message import Message
from schemas.ports import Port
from schemas.ros import CameraInfo, CompressedImage, DiagnosticStatus, Header, Image, Time
from schemas.trocar_msgs import ShownMarkers, SoftBodyState, SurfaceChange, SurfaceFilm
from schemas.vectors import Vector

if TYPE_CHECKING:
    from engines.mujoco.pictures.endoscope_scene import EndoscopeScene
    from engines.mujoco.truth.camera_truth import CameraTruth

__all__ = ["Endoscope", "camera_info"]

_log = logging.getLogger(__name__)

_WARNING = 1
"""Level of a DiagnosticStatus."""


class Endoscope(Stepped):
    """Two cameras at the tip of the ECM, or where the scenario puts them."""

    params_model: ClassVar[type[Params]] = EndoscopeParams
    params: EndoscopeParams
    observer: ClassVar[bool] = True

    def __init__(self, name: str, params: EndoscopeParams) -> None:
        super().__init__(name, params)
        self._seen = SeenState(params)
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
        self._events = self._pictures
        if kinds and params.looks == "endoscope":
            said = "from when and why looks are plain"
            self._events += (event_out("status", DiagnosticStatus, said),)
        self._said: DiagnosticStatus | None = None
        """To be published with the next step."""
        self._scene: EndoscopeScene | SceneApart | None = None
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
        qpos = signal_in("qpos", description=positions, size=self._seen.positions.size)
        changed = "difference of the surface from that of the first message; may be left unconnected"
        wet = "liquid on the surface; may be left unconnected"
        bodies = (
            port
            for organ in self._seen.bodies
            for port in (
                signal_in(f"{organ}/nodes", SoftBodyState, nodes, frame="world"),
                signal_in(f"{organ}/surface", SurfaceChange, changed, frame="world", start=()),
                signal_in(f"{organ}/film", SurfaceFilm, wet, frame="world", start=()),
            )
        )
        markers = signal_in("markers", ShownMarkers, shown, frame="world")
        return (qpos, *bodies, *((markers,) if self.params.markers else ()), *self._events)

    def configure(self, setup: Setup) -> Outputs:
        """Build the scene, unless soft bodies are missing from it.

        Without OpenGL it logs one warning and publishes no pictures; without Filament it logs one and draws
        plain looks.
        """
        for organ, body in self._seen.bodies.items():
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
            self._say(self._drawing.shortcoming)
        elif self.params.truth and not opengl.find().name:
            _log.warning(
                "participant '%s' publishes no truth: no OpenGL works here. To fix it: %s",
                self.name,
                opengl.REMEDY,
            )
        if not self._seen.bodies:
            self._build_scene("from the start")
        return self._outputs({})

    def _say(self, text: str) -> None:
        """Log and publish what is not as asked; `text`: the end of a sentence about this participant."""
        _log.warning("participant '%s' %s", self.name, text)
        self._said = DiagnosticStatus(level=_WARNING, name=self.name, message=text)

    def _build_scene(self, since: str) -> None:
        """Prepare to draw, if anything draws; `since`: from when, for a sentence."""
        if self._scene is None and isinstance(self._drawing.engine, Backend):
            try:
                self._scene = SceneApart(self.params, self._drawing.engine, self._seen)
                opengl.find()  # while the other process prepares: plain looks take over at once if it ends
                self._scene.wait()
            except DrawingLostError as error:
                self._take_plain(since, error)
        if self._scene is None and isinstance(self._drawing.engine, str) and self._drawing.engine:
            from engines.mujoco.pictures.endoscope_scene import EndoscopeScene

            self._scene = EndoscopeScene(self.params, self._drawing.engine, self._seen.bodies)
        if self._truth is None and self._scene and self.params.truth and opengl.find().name:
            from engines.mujoco.truth.camera_truth import CameraTruth

            self._truth = CameraTruth(self.params, self._seen.bodies)

    def _take_plain(self, since: str, error: DrawingLostError) -> None:
        """Draw plain looks from now on, as the process that drew has ended."""
        self._scene, self._drawing = None, find_drawing("plain")
        instead = self._drawing.shortcoming or "draws plain looks"
        self._say(f"{instead} {since}: the process that drew endoscope looks {error}")

    def _draw(self, t: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]] | None:
        """Return both pictures of the newest state; None: nothing draws."""
        since = f"from {t * 1e-9:.3f} s on"
        self._build_scene(since)
        if isinstance(self._scene, SceneApart):
            try:
                return self._scene.draw(t)
            except DrawingLostError as error:
                self._take_plain(since, error)
                self._build_scene(since)
        if self._scene is None or isinstance(self._scene, SceneApart):
            return None
        return self._scene.draw(self._seen.positions, self._seen.markers, t)

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Draw the state at `t`.

        Raises SessionError if a soft body is not what it was, or its surface unknown.
        """
        self._seen.accept(inputs)
        messages = dict(self._drawn(t)) if self._drawing.engine else {}
        if self._said is not None:
            messages["status"], self._said = self._said, None
        return self._outputs(messages)

    def _drawn(self, t: int) -> Iterator[tuple[str, Message]]:
        """Yield what is published of the newest state, by port."""
        pictures = self._draw(t)
        if pictures is None or self._scene is None:
            return
        header = Header(stamp=Time.from_ns(t), frame_id=self._frame)
        self._warn_inside(self._scene.lens, t)
        for eye, pixels in zip(EYES, pictures, strict=True):
            for name, message in self._messages(eye, pixels, header):
                yield f"{eye}/{name}", message
        if self._truth is not None:
            yield from self._truth.messages(self._seen.positions, header)

    def _warn_inside(self, lens: Vector, t: int) -> None:
        """Log a warning, once for each soft body, if the cameras are inside; `lens`: shape (3,), m."""
        for organ in enclosing_bodies(lens, self._seen.bodies):
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
        names = (port.name for port in self._events)
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
        return self._seen.save()

    def restore(self, state: bytes) -> None:
        """Return to a saved state. Raises StateError if it does not fit this scene."""
        try:
            self._seen.restore(state)
        except StateError as error:
            raise StateError(f"participant '{self.name}': {error}") from error
        if self._seen.bodies:
            self.close()  # their surfaces may be others

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
