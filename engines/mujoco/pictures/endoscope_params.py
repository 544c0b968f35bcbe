"""Parameters of the endoscope."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from engines.mujoco.object_params import NeedleParams
from engines.mujoco.params import SceneParams
from engines.mujoco.pictures.lens import NO_DISTORTION, Distortion, check_distortion
from engines.mujoco.pictures.sensor_params import SensorParams
from engines.mujoco.pictures.skin_params import SkinParams
from engines.mujoco.pictures.variation import RandomiseParams
from hub.participant import Params
from robots.dvrk import endoscope
from robots.dvrk.endoscope import StereoCamera
from robots.training.threads import THREAD
from schemas.quantity import Angle, Length
from schemas.scenario import Name

__all__ = ["EndoscopeParams", "ViewParams"]

_MOST_PIXELS = 2048
"""Most pixels of a side: an uncompressed picture of 2048 x 2048 is the largest in a message."""
_MOST_BYTES = 3 * _MOST_PIXELS**2
"""Most bytes of pixels in a message."""
Truth = Literal[
    "depth", "segmentation", "instances", "normals", "flow", "scene_flow", "occlusion", "keypoints"
]
_TRUTH_BYTES: Mapping[Truth, int] = {
    "depth": 4,
    "segmentation": 2,
    "instances": 2,
    "normals": 12,
    "flow": 8,
    "scene_flow": 12,
    "occlusion": 1,
    "keypoints": 0,
}
"""Bytes of a pixel; keypoints are a text."""


class ViewParams(Params):
    """Cameras that stand still in the world, upright."""

    position: tuple[Length, Length, Length] = Field(
        description="of the middle between the cameras, in the world"
    )
    target: tuple[Length, Length, Length] = Field(description="the point in the world they look at")

    @model_validator(mode="after")
    def _looks_somewhere(self) -> Self:
        if self.position == self.target:
            raise ValueError("position and target are the same point, so there is no direction to look in")
        return self


class EndoscopeParams(SceneParams):
    """The scene it looks at, the same as the robot's, and its cameras."""

    open_to_pages: ClassVar[bool] = True

    width: int = Field(default=endoscope.WIDTH, ge=16, le=_MOST_PIXELS, description="pixels of each picture")
    height: int = Field(
        default=endoscope.HEIGHT, ge=16, le=_MOST_PIXELS, description="pixels of each picture"
    )
    field_of_view: Angle = Field(default=endoscope.FIELD_OF_VIEW, gt=0.0, lt=3.0, description="horizontal")
    baseline: Length = Field(default=endoscope.BASELINE, ge=0.0, description="distance of the two cameras")
    distortion: Distortion = Field(
        default=NO_DISTORTION,
        description=(
            "of the lens, k1, k2, p1, p2 and k3 of the model `plumb_bob`, published in `camera_info`;"
            " default: none, as after rectification"
        ),
    )
    near: Length = Field(default=endoscope.NEAR, gt=0.0, description="anything nearer is invisible")
    far: Length | None = Field(
        default=None,
        gt=0.0,
        description=(
            "anything farther is invisible; default: 2 m at the endoscope's tip, elsewhere the whole scene"
        ),
    )
    view: ViewParams | None = Field(
        default=None,
        description=(
            "cameras fixed in the world; default: at the ECM's tip or, in a scene without ECM, looking at the"
            " whole scene"
        ),
    )
    skins: dict[Name, SkinParams] = Field(
        default_factory=dict[Name, SkinParams],
        description=(
            "soft bodies of other engines to draw; the input `<name>/nodes` receives the nodes of each. A"
            " needle of the scene that has a thread adds `thread`"
        ),
    )
    markers: bool = Field(
        default=False,
        description="draw what the input `markers` receives from a participant of kind `markers`",
    )
    images: Literal["raw", "compressed", "both", "none"] = Field(
        default="raw", description="what is published of each picture; none: the camera is off"
    )
    truth: tuple[Truth, ...] = Field(
        default=(),
        description=(
            "published beside the pictures, from the geometry and free of noise: depth (m, 32FC1),"
            " segmentation by class and instances (mono16), normals (32FC3); flow (px, 32FC2) and scene flow"
            " (m, 32FC3) from the picture before to this one, and occlusion (mono8, 255: a point of the"
            " picture before that is hidden or outside now), with the stamp of the picture before; keypoints"
            " (JSON): tip pose, joints, ends and shaft edges of instruments, and which are hidden"
        ),
    )
    format: Literal["jpeg", "png"] = Field(default="jpeg", description="of the compressed picture")
    quality: int = Field(
        default=95, ge=1, le=95, description="of a JPEG; above 95 files grow but pictures do not improve"
    )
    shadows: bool | None = Field(
        default=None,
        description=(
            "draw shadows, and reflections with plain looks; default: with endoscope looks. On a CPU plain"
            " pictures with shadows take several times as long, those of an endoscope two thirds more"
        ),
    )
    place: Literal["abdomen", "subhepatic", "dry-lab", "none"] | None = Field(
        default=None,
        description=(
            "surroundings with endoscope looks, subhepatic: below the liver of a patient whose triangle of"
            " Calot is at the origin, none: an even grey; default: a dry lab for a scene with a"
            " table, fixtures or objects, an abdomen for soft bodies alone, else none"
        ),
    )

    @property
    def camera(self) -> StereoCamera:
        """The two cameras."""
        return StereoCamera(self.width, self.height, self.field_of_view, self.baseline)

    @property
    def soft_bodies(self) -> dict[str, SkinParams]:
        """What is drawn of other engines, by name: `skins`, and the thread of a needle."""
        threads = (thing.thread for thing in self.objects.values() if isinstance(thing, NeedleParams))
        return ({THREAD: SkinParams()} if any(threads) else {}) | self.skins

    sensor: SensorParams = Field(
        default_factory=SensorParams, description="lens and sensor with endoscope looks"
    )

    smoke: float = Field(
        default=0.0, ge=0.0, le=1.0, description="smoke in the air with endoscope looks; 1: sight of a few cm"
    )
    randomise: RandomiseParams | None = Field(
        default=None,
        description=(
            "random differences of what is seen, all from one seed, with endoscope looks; the offset of the"
            " cameras with any; default: none"
        ),
    )

    @property
    def surroundings(self) -> Literal["abdomen", "subhepatic", "dry-lab", "none"]:
        """The place, chosen by the scene where it is not stated."""
        if self.place is not None:
            return self.place
        if self.table is not None or self.fixtures or self.objects:
            return "dry-lab"
        return "abdomen" if self.soft_bodies else "none"

    @model_validator(mode="after")
    def _sees_something(self) -> Self:
        if self.far is not None and self.far <= self.near:
            raise ValueError(f"far ({self.far:g} m) must be beyond near ({self.near:g} m)")
        check_distortion(self.camera, self.distortion)
        return self

    @model_validator(mode="after")
    def _truth_fits_a_message(self) -> Self:
        if len(set(self.truth)) < len(self.truth):
            raise ValueError("truth names something twice")
        for name in self.truth:
            if self.width * self.height * _TRUTH_BYTES[name] > _MOST_BYTES:
                raise ValueError(
                    f"{name} of {self.width} x {self.height} pixels is larger than a message: at most"
                    f" {_MOST_BYTES // _TRUTH_BYTES[name]} pixels; `trocar render --modalities` draws larger"
                    " ones from a recording"
                )
        return self
