"""A master with motors that turns where it is told: aligned by the console, it passes the gate of the
teleoperation, and leads in the camera's axes.
"""

from __future__ import annotations

import numpy as np
import pytest

from controllers.dvrk_console.controller import DvrkConsole
from controllers.dvrk_console.params import DvrkConsoleParams
from controllers.teleoperation.controller import Teleoperation
from controllers.teleoperation.params import TeleoperationParams
from hub.participant import Params, Stepped
from hub.testing import run_in_process
from robots import rotation
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.ros import BoolMessage, Joy
from tests.devices.ros.ideal_robot import IdealRobot, motion

pytest.importorskip("ruckig")

ARMS = {
    "PSM1": {"instrument": "400006", "start": [0.3, 0.2, 0.14, 0.4, 0.3, -0.2]},
    "ECM": {"start": [0.1, -0.2, 0.06, 0.2]},
}
WAY = np.array([-0.03, 0.01, 0.02])
"""Of the hand in the display's frame from 0.5 s to 0.7 s, m."""
POSE, JOY = "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/Joy"


class MasterWithMotors(Stepped):
    """Turns at once where `move_cp` wants it, if its motors are on."""

    params_model = Params
    motors = True

    @property
    def ports(self):
        fields = ("position", "velocity", "effort")
        events = {
            "MTMR/operating_state": "crtk_msgs/msg/OperatingState",
            "console/teleop/enable": "std_msgs/msg/Bool",
            "pedals/operatorpresent": JOY,
        }
        return (
            Port(name="MTMR/measured_cp", causality="output", type=POSE),
            Port(
                name="MTMR/gripper/measured_js",
                causality="output",
                type="sensor_msgs/msg/JointState",
                names=("gripper",),
                fields=fields,
            ),
            *(
                Port(name=name, causality="output", type=type_, variability="event")
                for name, type_ in events.items()
            ),
            Port(name="MTMR/move_cp", causality="input", type=POSE, variability="event"),
            Port(name="tip", causality="input", type=POSE, frame="ECM"),
            Port(name="following", causality="input", type="std_msgs/msg/Bool", variability="event"),
        )

    def configure(self, setup):
        self.pose = np.array([-0.1, -0.1, 0.3, *rotation.exp(np.array([1.0, 0.5, -0.7]))])
        self.start, self.tips, self.followed = self.pose[:3].copy(), {}, []
        return self.told(0)

    def told(self, t_ns, **events):
        gripper = np.array([0.5 + 0.5 * np.sin(t_ns * 1e-8), 0.0, 0.0])  # somebody squeezes it
        silent = dict.fromkeys(
            ("MTMR/operating_state", "console/teleop/enable", "pedals/operatorpresent"), ()
        )
        return {"MTMR/measured_cp": self.pose, "MTMR/gripper/measured_js": gripper, **silent, **events}

    def step(self, t, h, inputs):
        for order in inputs.events("MTMR/move_cp") if self.motors else ():
            q = order.pose.orientation
            self.pose[3:] = [q.x, q.y, q.z, q.w]
        self.pose[:3] = self.start + WAY * np.clip((t * 1e-9 - 0.5) / 0.2, 0.0, 1.0)
        self.tips[t // 1_000_000] = inputs["tip"].copy()
        self.followed += [(t // 1_000_000, message.data) for message in inputs.events("following")]
        if t:
            return self.told(t)
        present, ready = Joy(buttons=np.array([1], np.int32)), OperatingState(state="ENABLED", is_homed=True)
        first = {
            "MTMR/operating_state": (ready,),
            "console/teleop/enable": (BoolMessage(data=True),),
            "pedals/operatorpresent": (present,),
        }
        return self.told(t, **first)

    def state_hash(self):
        return 0

    def close(self):
        pass


def play(*, motors):
    controller = motion(arms=ARMS, mounting="cart", initial_state="homed", publish_period="2 ms")
    hand = {"instrument": "400006", "view": "display", "orientation": "follow", "align": "gate", "scale": 0.2}
    master = MasterWithMotors("master", Params())
    master.motors = motors
    participants = {
        "master": master,
        "console": DvrkConsole(
            "console",
            DvrkConsoleParams.model_validate({"arms": ["PSM1", "ECM"], "teleoperations": ["MTMR_PSM1"]}),
        ),
        "right": Teleoperation("right", TeleoperationParams.model_validate(hand)),
        "motion": controller,
        "robot": IdealRobot(controller),
    }
    connections = [
        *("master.* -> console.*", "master.MTMR/measured_cp -> right.master", "console.* -> master.*"),
        *(
            "console.MTMR_PSM1/following -> master.following",
            "motion.PSM1/measured_cp -> master.tip",
            "motion.* -> console.*",
            "console.* -> motion.*",
        ),
        *(
            "console.teleop/MTMR_PSM1/* -> right.*",
            "right.* -> console.teleop/MTMR_PSM1/*",
            "right.PSM1/* -> motion.PSM1/*",
        ),
        *(
            "motion.PSM1/operating_state -> right.operating_state",
            "motion.PSM1/setpoint_js -> right.measured_js",
        ),
        *(
            "motion.PSM1/jaw/setpoint_js -> right.jaw/measured_js",
            "motion.SUJ/PSM1/measured_cp -> right.base_in_view",
        ),
        *("motion.drive/* -> robot.*", "robot.* -> motion.sense/*"),
    ]
    scenario = {
        "name": "aligned",
        "step": "2 ms",
        "duration": "800 ms",
        "order": list(participants),
        "connections": connections,
    }
    assert run_in_process(scenario, participants).state == "done"
    return master


def test_a_master_is_turned_like_the_tip_and_then_leads_it_along_the_cameras_axes():
    master = play(motors=True)
    assert master.followed[-1][1]
    aligned = rotation.product(rotation.conjugate(master.pose[3:]), master.tips[400][3:])
    assert np.linalg.norm(rotation.log(aligned)) < 1e-3
    assert np.allclose(master.tips[798][:3] - master.tips[400][:3], 0.2 * WAY, atol=5e-5)


def test_a_master_that_does_not_turn_does_not_lead():
    master = play(motors=False)
    assert not any(follows for _, follows in master.followed)
    assert np.array_equal(master.tips[798], master.tips[400])
