"""What a tracker of instruments in the endoscope's pictures would report: a model, no picture is processed.

The true tip of each arm is projected into both eyes, moved by noise of the pictures, and triangulated. So its
depth is as uncertain as the endoscope's baseline makes it, and a tip out of view is not reported. SI units.
"""

from __future__ import annotations

from typing import Any, ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from controllers.motion.frames import base_in_world
from controllers.motion.params import Arms, EcmParams, SetupJoints
from controllers.ports import measured_joints
from hub.participant import Controller, Inputs, Outputs, Params, Setup, event_out, signal_in
from robots.dvrk import crtk, ecm, endoscope
from robots.dvrk.crtk import Mounting
from robots.dvrk.endoscope import FAR, NEAR, StereoCamera
from schemas.ports import Port
from schemas.ros import Header, Point, Pose, PoseStamped, PoseWithCovariance, Time
from schemas.ros import PoseWithCovarianceStamped as Seen
from schemas.vectors import Vector

__all__ = ["TipTracker", "TipTrackerParams"]

_UNKNOWN = np.pi**2
"""rad^2; of an orientation not reported."""


class TipTrackerParams(Params):
    """The arms, the cameras and the noise of their pictures."""

    open_to_pages: ClassVar[bool] = True

    arms: Arms
    mounting: Mounting = "free"
    setup_joints: SetupJoints = SetupJoints()
    width: int = Field(default=1200, ge=1, description="pixels of a picture, as wide for its height as ours")
    height: int = Field(
        default=1080, ge=1, description="as many as the Surgical Robotics Challenge prescribes"
    )
    noise: float = Field(
        default=0.5, gt=0.0, description="pixels; standard deviation of a tip's place in a picture (assumed)"
    )
    seed: int = Field(default=0, ge=0, description="of the noise")

    @model_validator(mode="after")
    def _has_cameras(self) -> Self:
        if self.arms.ECM is None:
            raise ValueError("the scene has no ECM, which holds the cameras")
        return self


class TipTracker(Controller):
    """Reports where the tips of all PSMs are seen: `<arm>/seen`."""

    params_model: ClassVar[type[Params]] = TipTrackerParams
    params: TipTrackerParams

    def __init__(self, name: str, params: TipTrackerParams) -> None:
        super().__init__(name, params)
        self._bases = {arm: base_in_world(arm, params) for arm in params.arms.present_arms if arm != "ECM"}
        self._camera = StereoCamera(params.width, params.height)
        held = params.arms.ECM or EcmParams()
        self._eye = endoscope.left_camera(held.endoscope, self._camera.baseline)
        self._stand = base_in_world("ECM", params)
        self._outputs: dict[str, Any] = {f"{arm}/seen": () for arm in self._bases}

    @property
    def ports(self) -> tuple[Port, ...]:
        """True tips and the true joints of the ECM in; sightings out."""
        true, seen = (
            "as the robot has it, not its controller",
            "where the tip is seen; its orientation is not",
        )
        return (
            measured_joints("ECM/measured_js", ecm.JOINT_NAMES),
            *(
                signal_in(f"{arm}/measured_cp", PoseStamped, true, frame=crtk.base_frame(arm))
                for arm in self._bases
            ),
            *(event_out(f"{arm}/seen", Seen, seen, frame=crtk.WORLD_FRAME) for arm in self._bases),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with nothing seen."""
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Look once."""
        n = len(ecm.JOINT_NAMES)
        eye = self._stand @ self._eye.forward(inputs["ECM/measured_js"][:n])
        for number, (arm, base) in enumerate(self._bases.items()):
            tip = (base @ [*inputs[f"{arm}/measured_cp"][:3], 1.0])[:3]
            seen = self._see_tip(eye[:3, :3].T @ (tip - eye[:3, 3]), t, number)
            self._outputs[f"{arm}/seen"] = () if seen is None else (_message(eye, *seen, t),)
        return self._outputs

    def _see_tip(self, tip: Vector, t: int, arm: int) -> tuple[Vector, Vector] | None:
        """Return where a tip at (3,) in the left eye is seen, (3,), and its covariance, (3, 3); None: not."""
        camera, noise = self._camera, self.params.noise
        x, y, z = tip.tolist()
        if not NEAR < z < FAR:
            return None
        f, b = camera.focal_length, camera.baseline
        pixels = np.array([f * x / z, f * y / z, f * (x - b) / z])  # left column, row, right column
        half = 0.5 * np.array([camera.width, camera.height, camera.width])
        if (np.abs(pixels) > half).any():
            return None
        drawn = np.random.Generator(np.random.Philox(key=[self.params.seed, arm], counter=t))
        left, row, right = (pixels + noise * drawn.standard_normal(3)).tolist()
        if left - right < 1.0:
            return None
        depth = f * b / (left - right)
        seen = depth / f * np.array([left, row, f])
        # of (left, row, right): depth = f b / (left - right)
        slope = np.outer(seen, [-1.0, 0.0, 1.0]) / (left - right)
        slope[0, 0] += depth / f
        slope[1, 1] += depth / f
        return seen, noise**2 * slope @ slope.T


def _message(eye: Vector, seen: Vector, covariance: Vector, t: int) -> Seen:
    """Return a sighting in the world; `eye`: pose of the left camera there, shape (4, 4)."""
    x, y, z = (eye[:3, :3] @ seen + eye[:3, 3]).tolist()
    spread = _UNKNOWN * np.eye(6)
    spread[:3, :3] = eye[:3, :3] @ covariance @ eye[:3, :3].T
    return Seen(
        header=Header(stamp=Time.from_ns(t), frame_id=crtk.WORLD_FRAME),
        pose=PoseWithCovariance(pose=Pose(position=Point(x=x, y=y, z=z)), covariance=spread.reshape(-1)),
    )
