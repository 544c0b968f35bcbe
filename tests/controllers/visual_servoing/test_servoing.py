"""The controller with drawn pictures and an ideal arm: what it does when pictures, discs or the arm fail."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from bench.vision_goals import random_goal
from controllers.visual_servoing.controller import VisualServoing
from controllers.visual_servoing.params import ServoingParams
from engines.mujoco.pictures.endoscope import camera_info
from hub.participant import Inputs, Setup
from hub.testing import check_engine
from robots.dvrk.endoscope import BASELINE, left_camera
from schemas.crtk import OperatingState
from schemas.ros import CameraInfo, Float64MultiArray, Header, Image, Time
from tests.controllers.visual_servoing.discs import CAMERA, features, picture

CHAIN = left_camera("straight", BASELINE)
H = 40_000_000
REACHED, START, TARGET = random_goal(np.random.default_rng(3))


class Session:
    """The controller, an arm that is where it was commanded to be, and pictures one period old."""

    def __init__(self, reached=REACHED, start=START, target=TARGET, **params):
        self.target, self.q, self.t = target, np.array(start), 0
        goal = params.pop("goal", features(CHAIN.forward(reached), target).tolist())
        given = {"goal": goal, "start": start.tolist()} | params
        self.controller = VisualServoing("servoing", ServoingParams.model_validate(given))
        self.outputs = self.controller.configure(Setup(H, Path()))
        self.states, self.warnings, self.before = [], [], self.q

    def step(self, count=1, covered=(), dark=False, **events):
        for _ in range(count):
            taken = CHAIN.forward(self.before)
            if not dark and self.t:
                header = Header(stamp=Time.from_ns(self.t - H))
                pixels = picture(cv2, taken, self.target, covered)
                events |= {
                    "left/camera_info": (camera_info(CAMERA, "left", header),),
                    "left/image_raw": (image(pixels, header),),
                }
            measured = np.concatenate([self.q, np.zeros(8)])
            self.outputs = self.controller.step(self.t, H, Inputs({"measured_js": measured}, events=events))
            self.before, self.q = self.q, self.outputs["servo_jp"][:4].copy()
            self.states += [message.data for message in self.outputs["state"]]
            self.warnings += [message.data for message in self.outputs["warning"]]
            self.t += H
            events = {}
        return self

    @property
    def error(self):
        return float(self.outputs["feature_error"][0])


def image(pixels, header=None):
    height, width, _ = pixels.shape
    return Image(
        header=header or Header(),
        height=height,
        width=width,
        encoding="rgb8",
        step=3 * width,
        data=pixels.reshape(-1),
    )


def test_the_goal_is_reached_and_kept():
    session = Session().step(65)
    assert session.states == ["blind", "moving", "reached"]
    assert session.error < 0.7
    assert session.step(25).states == ["blind", "moving", "reached"]
    assert np.allclose(session.q, REACHED, atol=0.01)


def test_the_command_has_the_velocity_with_which_it_moves():
    session = Session().step(10)
    before = session.q
    session.step()
    assert np.allclose(session.outputs["servo_jp"][4:], (session.q - before) / 0.04)
    jacobian = CHAIN.jacobian(CHAIN.frames(before), frame="tip")
    assert np.allclose(session.outputs["camera_velocity"], jacobian @ session.outputs["servo_jp"][4:])


def test_discs_that_are_lost_for_a_second_are_found_again():
    session = Session().step(15)
    held = session.q
    session.step(25, covered=(2,))
    assert np.allclose(session.q, held, atol=0.02)  # the one step until the picture is there
    held = session.q
    session.step(5, covered=(0, 1, 2, 3))
    assert (session.q == held).all()
    session.step(65)
    assert session.states == ["blind", "moving", "searching", "moving", "reached"]


def test_without_pictures_it_holds():
    session = Session().step(15).step(6, dark=True)
    held = session.q
    session.step(20, dark=True)
    assert (session.q == held).all()
    assert session.states[-1] == "blind"
    assert (session.outputs["camera_velocity"] == 0.0).all()
    assert session.step(65).states[-1] == "reached"


def test_an_arm_that_is_not_ready_is_left_where_it_is():
    session = Session().step(5)
    session.step(5, operating_state=(OperatingState(state="DISABLED", is_homed=True),))
    assert session.states[-1] == "waiting"
    session.q = session.q + np.array([0.01, 0.0, 0.0, 0.0])  # somebody moves it
    held = session.q
    session.step(5, dark=True)
    session.q = held
    session.step(1, operating_state=(OperatingState(state="ENABLED", is_homed=True),))
    assert np.allclose(session.q, held, atol=0.03)
    assert session.step(65).states[-1] == "reached"


@pytest.mark.long
def test_a_goal_out_of_reach_ends_in_a_sentence_with_the_residual():
    goal = features(CHAIN.forward(REACHED), TARGET) * [1.0, 1.4]
    session = Session(goal=goal.tolist()).step(120)
    assert session.states[-1] == "settled"
    stated = float(session.warnings[-1].partition("at rest ")[2].partition(" px")[0])
    assert stated == pytest.approx(session.error, rel=0.01)
    assert stated > 1.0
    other = Float64MultiArray(data=features(CHAIN.forward(REACHED), TARGET).ravel())
    assert session.step(1, goal=(other,)).step(60).states[-1] == "reached"


@pytest.mark.parametrize("data", [[0.0] * 7, [np.nan] * 8, []])
def test_a_goal_that_is_none_is_refused(data):
    session = Session().step(3)
    bad = Float64MultiArray.model_construct(data=np.array(data))
    before = session.outputs["features_goal"].copy()
    session.step(1, goal=(bad,))
    assert "is refused: eight finite ones are needed" in session.warnings[-1]
    assert (session.outputs["features_goal"] == before).all()


def test_pictures_that_do_not_fit_are_refused_and_nothing_moves():
    session = Session().step(3)
    session.step(1, dark=True, **{"left/image_raw": (image(np.zeros((10, 12, 3), np.uint8)),)})
    assert "12 x 10 (rgb8) is refused" in session.warnings[-1]
    info = camera_info(CAMERA, "left", Header()).model_copy(update={"d": np.array([0.1, 0, 0, 0, 0])})
    assert isinstance(info, CameraInfo)
    session.step(1, dark=True, **{"left/camera_info": (info,)})
    assert "must be rectified" in session.warnings[-1]


def test_a_saved_session_goes_on_bit_for_bit():
    first = Session().step(12)
    second = Session()
    second.controller.restore(first.controller.save())
    second.q, second.before, second.t = first.q, first.before, first.t
    for _ in range(10):
        assert first.step().controller.state_hash() == second.step().controller.state_hash()


def test_it_keeps_the_contract_of_participants():
    check_engine(lambda: VisualServoing("servoing", ServoingParams()), period_ns=H)


@pytest.mark.parametrize("wrong", [{"goal": [[0, 0]] * 4}, {"gain": 50.0}, {"start": [9, 0, 0, 0]}])
def test_parameters_without_sense_are_refused(wrong):
    with pytest.raises(ValidationError):
        ServoingParams.model_validate(wrong)
