"""The needle tracker as a participant: pictures and joints in, the needle's pose and how sure it is out.

A picture is of the instant of its stamp, and comes later: it is matched with where the arms were then. What
comes out is where the needle is now, by where the arms are now. Without pictures the kinematics go on, and
the covariance grows.
"""

from __future__ import annotations

from enum import IntEnum
from typing import ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from controllers.motion.frames import base_in_world
from controllers.motion.params import EcmParams
from controllers.needle_tracker.arc_fit import Arc
from controllers.needle_tracker.filter import Estimate, NeedleView
from controllers.needle_tracker.noise import Noise
from controllers.needle_tracker.overlay import draw_overlay
from controllers.needle_tracker.params import TrackerParams
from controllers.needle_tracker.ports import tracker_ports
from controllers.needle_tracker.segmentation import Region, detect_needle, region_about
from controllers.needle_tracker.tracking import NeedleBelief, TrackerSettings, follow_needle
from controllers.pictures import PictureController
from controllers.ports import CAMERA
from hub.participant import (
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    Value,
    array,
    choice,
    flag,
    integer,
    number,
)
from robots.dvrk import crtk
from robots.dvrk.endoscope import EYES, Eye, left_camera
from robots.training.needles import NEEDLES
from robots.transform import inverse_transform, matrix_to_pose, pose_to_matrix
from schemas.ports import Port
from schemas.ros import (
    CameraInfo,
    Header,
    Image,
    Point,
    Pose,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    StringMessage,
    Time,
)
from schemas.vectors import Vector

__all__ = ["NeedleTracker"]

_TIP_AHEAD = 0.086e-3
"""m from the end of the wire to the middle of what is seen of the ball around it, of radius a = 0.45 mm.

The wire, of radius 0.4 mm, covers the ball behind c = sqrt(0.45^2 - 0.4^2) mm; the rest of its disc has the
centroid 2/3 (a^2 - c^2)^(3/2) / (pi a^2 - a^2 acos(c / a) + c sqrt(a^2 - c^2)).
"""
_KEPT = 16
"""Instants of which it is known where the arms were: pictures may be older by as many steps."""
_REGION = 2.2
"""Radius of the sphere looked at, in radii of the needle; its centre is fixed in the gripper, where
the arc's centre was when the tracker started.
"""


class TrackerPhase(IntEnum):
    """What the pose is from."""

    BLIND = 0
    PREDICTING = 1
    TRACKING = 2


class TrackerState(Record):
    """What is known of the needle, and where the arms were."""

    pose = array(4, 4)
    """Pose of the needle in the gripper."""
    covariance = array(6, 6)
    doubts = integer()
    seen = flag()
    share = number()
    slips = number()
    picture_ns = integer(-1)
    phase = choice(TrackerPhase.BLIND)
    steps = integer()
    at = array(_KEPT)
    """s, of the arms' poses."""
    grippers = array(_KEPT, 4, 4)
    """The gripper in the left camera's frame."""
    projections = array(2, 3, 4)
    """Projections from the left camera's frame to the pixels of each eye; zeros before camera_info."""
    sizes = array(2, 2)
    """Width and height of the eyes' pictures, px."""


class NeedleTracker(PictureController):
    """A needle in one gripper, seen by one eye or two."""

    params_model: ClassVar[type[Params]] = TrackerParams
    params: TrackerParams
    kind = "needle-tracker"

    def __init__(self, name: str, params: TrackerParams) -> None:
        super().__init__(name, params)
        self._arc = Arc(NEEDLES[params.needle], _TIP_AHEAD)
        self._eyes: tuple[Eye, ...] = EYES if params.eyes == "both" else EYES[:1]
        self._base = base_in_world(params.arm, params)
        self._camera_base = base_in_world("ECM", params)
        self._chain = params.holder.chain
        self._camera = left_camera(
            cast("EcmParams", params.arms.present_arms["ECM"]).endoscope, params.baseline
        )
        self._middle = np.array(params.grasp.position)
        self._settings = TrackerSettings(
            Noise(params.arc_noise, params.tip_noise, params.lasting, params.shading, params.capping),
            (params.drift.position, params.drift.angle),
            (params.slip.position, params.slip.angle),
        )
        self._now = TrackerState()
        self.keep(self._now)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Both eyes' pictures and the joints of both arms in; the needle's pose out."""
        return tracker_ports(self.params)

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with the grasp that the parameters state. Raises MissingExtraError without OpenCV."""
        self._load_opencv()
        grasp, now = self.params.grasp, self._now
        now.pose[:] = pose_to_matrix(np.array([*grasp.position, *grasp.orientation]))
        deviations = np.repeat([grasp.position_deviation, grasp.angle_deviation], 3)
        now.covariance[:] = np.diag(deviations**2)
        now.doubts = NeedleBelief(Estimate(now.pose, now.covariance)).doubts
        arms = self.params.arms.present_arms
        start = np.array(self.params.holder.start), np.array(arms["ECM"].start)
        in_base = self._chain.forward(start[0])
        return self._outputs(0, in_base, self._in_camera(in_base, start[1]), TrackerPhase.BLIND, ())

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Follow the needle through the newest pictures."""
        now, before = self._now, self._now.phase
        self._warnings.clear()
        joints = inputs[f"{self.params.arm}/measured_js"][: len(self._chain.joints)]
        in_base = self._chain.forward(joints)
        in_camera = self._in_camera(in_base, inputs["ECM/measured_js"][: len(self._camera.joints)])
        slot = now.steps % _KEPT
        now.at[slot], now.grippers[slot], now.steps = t * 1e-9, in_camera, now.steps + 1
        self._run_calibration(inputs)
        pictures = self._pictures(inputs)
        overlay = self._follow(pictures, h * 1e-9)
        if self._is_blind(t, now.picture_ns):
            now.phase = TrackerPhase.BLIND
        elif pictures:
            now.phase = TrackerPhase.TRACKING if now.seen else TrackerPhase.PREDICTING
        return self._outputs(t + h, in_base, in_camera, before, overlay)

    def _in_camera(self, in_base: Vector, camera_joints: Vector) -> Vector:
        """Return the gripper's pose in the left camera's frame, shape (4, 4), by its pose in its base."""
        camera = self._camera_base @ self._camera.forward(camera_joints)
        return inverse_transform(camera) @ self._base @ in_base

    def _run_calibration(self, inputs: Inputs) -> None:
        for i, eye in enumerate(self._eyes):
            for info in cast("tuple[CameraInfo, ...]", inputs.events(f"{eye}/camera_info")):
                if info.p[0] > 0.0 and not info.d.any():
                    self._now.projections[i] = info.p.reshape(3, 4)
                    self._now.sizes[i] = info.width, info.height
                else:
                    self._warn(f"camera_info of the {eye} eye is refused: the picture must be rectified")

    def _pictures(self, inputs: Inputs) -> dict[int, NDArray[np.uint8]]:
        """Return the newest picture of each eye, by its number; all of one instant."""
        found: dict[int, NDArray[np.uint8]] = {}
        now = self._now
        newest = [
            (i, cast("Image", events[-1]))
            for i, eye in enumerate(self._eyes)
            if now.projections[i].any() and (events := inputs.events(f"{eye}/image_raw"))
        ]
        if not newest:
            return found
        taken = max(image.header.stamp.ns for _, image in newest)
        for i, image in newest:
            picture = self._accepted_pixels(image, *now.sizes[i].tolist())
            if picture is not None and image.header.stamp.ns == taken:
                found[i] = picture
        if found:
            now.picture_ns = taken
        return found

    def _follow(self, pictures: dict[int, NDArray[np.uint8]], seconds: float) -> tuple[Image, ...]:
        """Update what is known; return the picture with what was seen, if one is wanted."""
        now = self._now
        gripper = self._gripper_at(now.picture_ns * 1e-9)
        regions, views = dict[int, Region](), dict[int, NeedleView]()
        for i, picture in pictures.items():
            projection = now.projections[i] @ gripper
            radius = _REGION * self._arc.needle.radius
            region = region_about(projection, self._middle, radius, picture.shape[1], picture.shape[0])
            if region is not None:
                depth = float(projection[2] @ [*self._middle, 1.0])
                regions[i] = region
                wire = self._arc.width(projection, depth)
                views[i] = NeedleView(projection, detect_needle(self._cv2, picture, region, wire))
        belief = NeedleBelief(Estimate(now.pose.copy(), now.covariance.copy()), now.doubts)
        belief = follow_needle(self._arc, belief, tuple(views.values()), seconds, self._settings)
        now.pose[:], now.covariance[:] = belief.estimate.pose, belief.estimate.covariance
        now.doubts = belief.doubts
        if pictures:
            now.seen, now.share = belief.seen, belief.share
        if belief.slipped:
            now.slips += 1.0
            self._warn("the needle was found elsewhere than expected: it has slipped")
        if not self.params.overlay or 0 not in pictures:
            return ()
        projection = now.projections[0] @ gripper
        seen = views[0].seen if 0 in views else None
        return (
            _image(
                draw_overlay(self._cv2, pictures[0], regions.get(0), seen, self._arc, projection, now.pose),
                now.picture_ns,
            ),
        )

    def _gripper_at(self, seconds: float) -> Vector:
        """Return where the gripper was in the left camera's frame, (4, 4), at the instant nearest to this."""
        now = self._now
        kept = min(now.steps, _KEPT)
        return now.grippers[int(np.argmin(abs(now.at[:kept] - seconds)))]

    def _outputs(
        self, t: int, in_base: Vector, in_camera: Vector, before: TrackerPhase, overlay: tuple[Image, ...]
    ) -> Outputs:
        now = self._now
        needle = in_base @ now.pose
        outputs: dict[str, Value] = {
            "kalmanOutput": matrix_to_pose(needle),
            "Tcn_hat": (in_camera @ now.pose)[:3].reshape(-1),
            "pose_with_covariance": (self._with_covariance(t, needle),),
            "covariance": now.covariance.reshape(-1),
            "seen_share": now.part("share"),
            "slips": now.part("slips"),
            "state": (StringMessage(data=now.phase.name.lower()),) if now.phase is not before else (),
            "warning": tuple(self._warnings),
        }
        return outputs | {"overlay/image_raw": overlay} if self.params.overlay else outputs

    def _with_covariance(self, t: int, needle: Vector) -> PoseWithCovarianceStamped:
        turn = np.kron(np.eye(2), needle[:3, :3])
        x, y, z, *quaternion = matrix_to_pose(needle).tolist()
        return PoseWithCovarianceStamped(
            header=Header(stamp=Time.from_ns(t), frame_id=crtk.base_frame(self.params.arm)),
            pose=PoseWithCovariance(
                pose=Pose(
                    position=Point(x=x, y=y, z=z),
                    orientation=Quaternion(**dict(zip("xyzw", quaternion, strict=True))),
                ),
                covariance=(turn @ self._now.covariance @ turn.T).reshape(-1),
            ),
        )


def _image(picture: NDArray[np.uint8], stamp_ns: int) -> Image:
    height, width, _ = picture.shape
    return Image(
        header=Header(stamp=Time.from_ns(stamp_ns), frame_id=CAMERA),
        height=height,
        width=width,
        encoding="rgb8",
        step=3 * width,
        data=picture.reshape(-1),
    )
