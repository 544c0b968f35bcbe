"""The tracker as a participant, with drawn pictures and arms that are where they are commanded to be."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from controllers.needle_tracker.arc_fit import Arc
from controllers.needle_tracker.controller import _TIP_AHEAD, NeedleTracker
from controllers.needle_tracker.params import TrackerParams
from controllers.needle_tracker.pose import move_pose, pose_error
from controllers.needle_tracker.segmentation import Region, detect_needle, region_about
from controllers.needle_tracker.tracking_error import TrackingError, TrackingErrorParams
from engines.mujoco.pictures.endoscope import camera_info
from hub.participant import Inputs, Setup
from hub.planning.scenario_file import load
from hub.testing import check_engine
from robots.dvrk.endoscope import EYES, StereoCamera, left_camera
from robots.training.needles import NEEDLES
from robots.transform import inverse_transform, matrix_to_pose, pose_to_matrix
from schemas.ros import Header, Image, PoseWithCovarianceStamped, Time
from tests.controllers.visual_servoing.test_servoing import image

H = 40_000_000
CAMERA = StereoCamera()
NEEDLE = NEEDLES["sh-plus"]
ARC = Arc(NEEDLE, _TIP_AHEAD)


def drawn(projection, needle, *, covered=False):
    """A picture of a needle with `pose` in the frame that `projection` is from, (288, 320, 3)."""
    picture = np.full((CAMERA.height, CAMERA.width, 3), (190, 90, 80), np.uint8)
    line, _, depth = ARC.project_line(projection, needle)
    corners = [np.round(line * 16).astype(np.int32)]
    cv2.polylines(picture, corners, False, (10, 200, 20), round(ARC.width(projection, depth)), cv2.LINE_AA, 4)
    if not covered:
        tip = np.round(line[-1] * 16).astype(int)
        cv2.circle(picture, tip.tolist(), 26, (10, 20, 240), -1, cv2.LINE_AA, 4)
    return picture


class Session:
    """A tracker of the installed scenario, its arms and its needle."""

    def __init__(self, **params):
        given = load("needle-tracking", []).params["tracker"]
        self.params = TrackerParams.model_validate(given.model_dump(exclude_unset=True) | params)
        self.tracker = NeedleTracker("tracker", self.params)
        self.outputs = self.tracker.configure(Setup(H, Path()))
        self.joints = np.array(self.params.holder.start)
        self.camera_joints = np.array(self.params.arms.present_arms["ECM"].start)
        self.grasp = move_pose(
            pose_to_matrix(np.array([*self.params.grasp.position, *self.params.grasp.orientation])),
            np.array([1e-3, -1e-3, 1.5e-3, 0.05, -0.1, 0.08]),
        )
        self.t, self.states, self.warnings, self.before = 0, [], [], self.in_camera()

    def in_camera(self):
        ecm, psm = self.params.arms.present_arms["ECM"], self.params.holder
        chain = left_camera(ecm.endoscope, self.params.baseline)
        camera = pose_to_matrix(np.array([*ecm.position, *ecm.orientation])) @ chain.forward(
            self.camera_joints
        )
        base = pose_to_matrix(np.array([*psm.position, *psm.orientation]))
        return inverse_transform(camera) @ base @ psm.chain.forward(self.joints) @ self.grasp

    def step(self, count=1, *, dark=False, covered=False, move=True):
        for _ in range(count):
            events = {}
            if self.t and not dark:
                header = Header(stamp=Time.from_ns(self.t - H))
                for eye in EYES:
                    picture = drawn(CAMERA.projection(eye), self.before, covered=covered)
                    events[f"{eye}/image_raw"] = (image(picture, header),)
                    events[f"{eye}/camera_info"] = (camera_info(CAMERA, eye, header),)
            values = {
                "PSM1/measured_js": np.concatenate([self.joints, np.zeros(12)]),
                "ECM/measured_js": np.concatenate([self.camera_joints, np.zeros(8)]),
            }
            self.before = self.in_camera()
            self.outputs = self.tracker.step(self.t, H, Inputs(values, events=events))
            self.states += [message.data for message in self.outputs["state"]]
            self.warnings += [message.data for message in self.outputs["warning"]]
            self.t += H
            if move:
                phase = self.t * 1e-9
                self.joints[[0, 3, 5]] = 0.05 * np.sin(phase * np.array([2.0, 3.0, 2.5]))
        return self

    @property
    def error(self):
        """Of the estimate in the camera's frame: mm along, and degrees about, the axes of the needle."""
        estimate = np.eye(4)
        estimate[:3] = self.outputs["Tcn_hat"].reshape(3, 4)
        return pose_error(estimate, self.before) * ([1e3] * 3 + [57.3] * 3)


def test_it_starts_follows_and_says_where_the_needle_is():
    session = Session().step(20)
    assert session.states == ["tracking"]
    assert np.linalg.norm(session.error[:3]) < 0.6
    assert abs(session.error[3:]).max() < 2.0
    (stated,) = session.outputs["pose_with_covariance"]
    assert isinstance(stated, PoseWithCovarianceStamped)
    assert stated.header.frame_id == "PSM1_base"
    assert stated.header.stamp.ns == session.t
    assert np.allclose(
        [stated.pose.pose.position.x, stated.pose.pose.position.y, stated.pose.pose.position.z],
        session.outputs["kalmanOutput"][:3],
    )
    turn = pose_to_matrix(session.outputs["kalmanOutput"])[:3, :3]
    own = session.outputs["covariance"].reshape(6, 6)
    assert np.allclose(stated.pose.covariance.reshape(6, 6)[:3, :3], turn @ own[:3, :3] @ turn.T)
    assert np.linalg.eigvalsh(own).min() > 0.0


def test_without_pictures_it_goes_on_by_kinematics_and_says_that_it_is_less_sure():
    session = Session().step(20)
    sure = session.outputs["covariance"].copy()
    session.step(15, dark=True)
    assert session.states[-1] == "blind"
    assert np.linalg.norm(session.error[:3]) < 0.6
    assert (np.diag(session.outputs["covariance"].reshape(6, 6)) > np.diag(sure.reshape(6, 6))).all()
    assert session.step(2).states[-1] == "tracking"


def test_a_slip_is_found_and_said():
    session = Session().step(15)
    held = NEEDLE.points(np.array([-0.2]))[0]
    turn = move_pose(np.eye(4), np.array([0, 0, 0, -0.25, 0.2, 0.15]))
    turn[:3, 3] = held - turn[:3, :3] @ held
    session.grasp = session.grasp @ turn
    session.step(20)
    assert np.linalg.norm(session.error[:3]) < 1.5
    assert abs(session.error[3:]).max() < 3.0
    assert session.outputs["slips"][0] == 1.0
    assert any("it has slipped" in warning for warning in session.warnings)


def test_a_picture_that_does_not_fit_is_refused():
    session = Session().step(3)
    bad = image(np.zeros((10, 12, 3), np.uint8), Header(stamp=Time.from_ns(session.t - H)))
    values = {"PSM1/measured_js": np.zeros(18), "ECM/measured_js": np.zeros(12)}
    outputs = session.tracker.step(session.t, H, Inputs(values, events={"left/image_raw": (bad,)}))
    assert "12 x 10 (rgb8) is refused" in outputs["warning"][0].data


def test_the_overlay_shows_the_estimate_on_the_left_picture():
    (overlay,) = Session(overlay=True).step(5).outputs["overlay/image_raw"]
    assert isinstance(overlay, Image)
    assert (overlay.height, overlay.width) == (CAMERA.height, CAMERA.width)
    picture = overlay.data.reshape(overlay.height, overlay.width, 3).astype(int)
    assert (abs(picture - (255, 60, 40)).sum(axis=2) < 60).sum() > 20  # the estimate's line
    assert "overlay/image_raw" not in {port.name for port in Session(overlay=False).tracker.ports}


def test_a_saved_session_goes_on_bit_for_bit():
    first, second = Session().step(6), Session()
    second.tracker.restore(first.tracker.save())
    second.joints[:], second.t, second.before = first.joints, first.t, first.before
    for _ in range(5):
        assert first.step().tracker.state_hash() == second.step().tracker.state_hash()


def test_colours_are_found_where_they_are():
    needle = Session().before
    projection = CAMERA.projection("left")
    picture = drawn(projection, needle)
    line, _, depth = ARC.project_line(projection, needle)
    region = region_about(projection, needle[:3, 3], 2.0 * NEEDLE.radius, CAMERA.width, CAMERA.height)
    assert region is not None
    assert (line.min(axis=0) > (region.left, region.top)).all()
    assert (line.max(axis=0) < (region.right, region.bottom)).all()
    seen = detect_needle(cv2, picture, region, ARC.width(projection, depth))
    assert np.linalg.norm(seen.tips - line[-1], axis=1).min() < 0.3
    away = np.linalg.norm(seen.points[:, None] - line[None], axis=2).min(axis=1)
    assert np.percentile(away, 95) < 3.0
    length = np.hypot(*np.diff(line, axis=0).T).sum()
    assert seen.lengths.sum() == pytest.approx(length, rel=0.7)
    nothing = detect_needle(cv2, np.zeros_like(picture), Region(0, 0, 320, 288), 2.0)
    assert nothing.points.shape == (0, 2)
    assert nothing.tips.shape == (0, 2)
    assert region_about(projection, np.array([0.0, 0.0, -0.1]), 0.02, 320, 288) is None
    assert region_about(projection, np.array([0.5, 0.0, 0.1]), 0.02, 320, 288) is None


def test_it_keeps_the_contract_of_participants():
    def make():
        return Session().tracker

    check_engine(
        make,
        period_ns=H,
        inputs={"PSM1/measured_js": np.full(18, 0.01), "ECM/measured_js": np.full(12, 0.05)},
    )


@pytest.mark.parametrize(
    "wrong", [{"arms": {"PSM1": {"instrument": "LARGE_NEEDLE_DRIVER_400006"}}}, {"needle": "sewing"}]
)
def test_parameters_without_sense_are_refused(wrong):
    with pytest.raises(ValidationError):
        Session(**wrong)


def test_the_error_is_what_lies_between_truth_and_estimate():
    given = load("needle-tracking", []).params["check"]
    checker = TrackingError("check", TrackingErrorParams.model_validate(given.model_dump(exclude_unset=True)))
    checker.configure(Setup(H, Path()))
    base = pose_to_matrix(np.array([0, 0, 0.13264, 0, 0, 0, 1.0]))
    estimate = pose_to_matrix(np.array([0.01, 0.0, -0.1, 0.0, 0.0, 0.0, 1.0]))
    off = np.array([1e-3, 0, 2e-3, 0, 0.1, 0.05])
    covariance = np.diag(np.full(6, 1e-2))
    outputs = checker.step(
        0,
        H,
        Inputs(
            {
                "truth": matrix_to_pose(base @ move_pose(estimate, off)),
                "estimate": matrix_to_pose(estimate),
                "covariance": covariance.reshape(-1),
            }
        ),
    )
    assert np.allclose(outputs["pose_error"], off, atol=1e-9)
    assert outputs["position_error"][0] == pytest.approx(np.sqrt(5.0) * 1e-3)
    assert outputs["nees"][0] == pytest.approx(100.0 * off @ off)
    assert np.allclose(outputs["pose_deviation"], 0.1)
    check_engine(
        lambda: TrackingError("check", checker.params),
        period_ns=H,
        inputs={
            "truth": matrix_to_pose(base),
            "estimate": matrix_to_pose(estimate),
            "covariance": covariance.ravel(),
        },
    )
