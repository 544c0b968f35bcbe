"""A motion to the right on the desk is one to the right in the picture, in a whole cart seen through MuJoCo's
kinematics and the endoscope's projection.
"""

import mujoco
import numpy as np
import pytest

from controllers.teleoperation.params import TeleoperationParams
from controllers.teleoperation.view import View
from engines.mujoco.model import build
from engines.mujoco.params import MujocoParams
from robots import rotation
from robots.dvrk.endoscope import StereoCamera, optical_in_roll
from tests.controllers.motion.rig import Rig
from tests.controllers.teleoperation.rig import Session

DRIVER = "LARGE_NEEDLE_DRIVER_400006"
STARTS = {
    "PSM1": [np.radians(39.7), np.radians(9.9), 0.146, 0.2, -0.1, 0.3],
    "PSM2": [np.radians(-24.4), np.radians(12.1), 0.164, 0.0, 0.0, 0.0],
    "ECM": [0.1, -0.15, 0.05, 0.4],
}
AWAY, LEFT, UP = np.eye(3)
WAY = 0.005
"""Of the hand, m."""


class Cart:
    """The cart in MuJoCo, where the arms are told to be; and the motion controller, which tells where an
    arm's base is in the camera's frame.
    """

    def __init__(self, endoscope, tip_frame):
        self.endoscope = endoscope
        arms = {
            "PSM1": {"instrument": DRIVER},
            "PSM2": {"instrument": DRIVER},
            "ECM": {"endoscope": endoscope, "tip_frame": tip_frame},
        }
        self.model = build(MujocoParams.model_validate({"mounting": "cart", "arms": arms, "looks": False}))
        self.data = mujoco.MjData(self.model)
        motion = Rig(arms={name: arm | {"start": STARTS[name]} for name, arm in arms.items()})
        for port, value in motion.sensed.items():
            name = port.split("/")[1]
            if "jaw" not in port:
                value[: len(STARTS[name])] = STARTS[name]
        motion.follows = False
        motion.step(count=11)
        self.base_in_view = {
            name: motion.outputs[f"SUJ/{name}/measured_cp"].copy() for name in ("PSM1", "PSM2")
        }
        for name, start in STARTS.items():
            self.put(name, start)

    def put(self, arm, positions):
        names = ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")
        for name, position in zip(names, positions, strict=False):
            self.data.qpos[self.model.joint(f"{arm}/{name}").qposadr[0]] = position
        mujoco.mj_kinematics(self.model, self.data)

    def seen(self, arm):
        """Where the arm's tip is in the left picture, pixels right and down, and how far ahead of the camera,
        m.
        """
        camera = np.eye(4)
        roll = self.data.body("ECM/roll")
        camera[:3, :3], camera[:3, 3] = roll.xmat.reshape(3, 3), roll.xpos
        point = np.linalg.inv(camera @ optical_in_roll(self.endoscope)) @ [
            *self.data.site(f"{arm}/tip").xpos,
            1.0,
        ]
        u, v, w = StereoCamera().projection("left") @ point
        return np.array([u / w, v / w, w])


@pytest.mark.parametrize("arm", ["PSM1", "PSM2"])
@pytest.mark.parametrize("tip_frame", ["kinematic", "view"])
@pytest.mark.parametrize("endoscope", ["straight", "up", "down"])
def test_right_up_and_away_on_the_desk_are_right_up_and_away_in_the_picture(endoscope, tip_frame, arm):
    cart = Cart(endoscope, tip_frame)
    focal = StereoCamera().focal_length
    for direction, change in ((-LEFT, (1, 0, 0)), (UP, (0, -1, 0)), (AWAY, (0, 0, 1))):
        session = Session(
            arm=arm,
            instrument=DRIVER,
            start=STARTS[arm],
            scale=1.0,
            view="camera",
            endoscope=endoscope,
            tip_frame=tip_frame,
            orientation="follow",
        )
        session.values["base_in_view"][:] = cart.base_in_view[arm]
        session.step()
        cart.put(arm, session.command)
        before = cart.seen(arm)
        session.hand[:3] += WAY * direction
        session.step(count=100)
        cart.put(arm, session.command)
        u, v, ahead = cart.seen(arm)
        moved = (
            np.array(
                [
                    (u - 159.5) * ahead - (before[0] - 159.5) * before[2],
                    (v - 143.5) * ahead - (before[1] - 143.5) * before[2],
                    0.0,
                ]
            )
            / focal
        )
        moved[2] = ahead - before[2]
        assert np.allclose(moved, WAY * np.array(change), atol=1e-7)


@pytest.mark.parametrize("endoscope", ["straight", "up", "down"])
def test_a_stylus_that_points_ahead_points_along_the_endoscope(endoscope):
    """A stylus' own frame has z out of its point, x to the right and y down, as the endoscope's optical
    frame; so a matched hand looks as the tip does.
    """
    cart = Cart(endoscope, "kinematic")
    pointing = np.array([-LEFT, -UP, AWAY]).T  # columns: the stylus' axes on the desk
    view = View(TeleoperationParams(view="camera", endoscope=endoscope))
    to_base = rotation.matrix(view.hand_in_base(cart.base_in_view["PSM1"]))
    camera = cart.data.body("ECM/roll").xmat.reshape(3, 3) @ optical_in_roll(endoscope)[:3, :3]
    base = cart.data.site("PSM1/base").xmat.reshape(3, 3)
    assert np.allclose(base @ to_base @ pointing, camera, atol=1e-6)


def test_a_turned_stylus_is_registered_to_the_desk():
    turn = rotation.exp(np.array([0.0, 0.0, 0.4]))
    base_in_view = np.array([0.1, 0.2, 0.3, *rotation.exp(np.array([0.5, -1.0, 0.3]))])
    straight, turned = (
        View(TeleoperationParams(view="camera", registration=tuple(q))).hand_in_base(base_in_view)
        for q in (np.array([0, 0, 0, 1.0]), turn)
    )
    assert np.allclose(turned, rotation.product(straight, turn))


def test_a_master_that_tells_its_pose_in_the_displays_frame_moves_the_tip_along_the_cameras_axes():
    base_in_view = np.array([0.1, 0.0, 0.2, *rotation.exp(np.array([0.3, -0.8, 0.5]))])
    to_base = View(TeleoperationParams.model_validate({"view": "display"})).hand_in_base(base_in_view)
    assert np.allclose(rotation.matrix(base_in_view[3:]) @ rotation.matrix(to_base), np.eye(3), atol=1e-12)
