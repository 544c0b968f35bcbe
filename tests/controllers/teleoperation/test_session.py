"""Two hands lead two arms of a cart through the motion controller and MuJoCo, as the endoscope shows them."""

import numpy as np
import pytest

from controllers.motion.controller import MotionController
from controllers.motion.params import MotionParams
from controllers.teleoperation.controller import Teleoperation
from controllers.teleoperation.params import TeleoperationParams
from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.participant import Device, Params, Sample, Stepped
from hub.testing import run_in_process
from schemas.crtk import StringStamped
from schemas.errors import ScenarioError
from schemas.ports import Port
from schemas.ros import Header, Joy, Point, Pose, PoseStamped, Time

pytest.importorskip("mujoco")
pytest.importorskip("ruckig")

POSE = "geometry_msgs/msg/PoseStamped"
ARMS = {
    "PSM1": {"instrument": "400006", "start": ["39.7 deg", "9.9 deg", "146 mm", 0, 0, 0], "jaw": "40 deg"},
    "PSM2": {"instrument": "400006", "start": ["-24.4 deg", "12.1 deg", "164 mm", 0, 0, 0], "jaw": "20 deg"},
    "ECM": {"tip_frame": "view", "start": [0, 0, "50 mm", 0]},
}
SCALE = 0.5
WAY = np.array([0.02, -0.01, 0.016])
"""Of either hand from 0.1 s to 0.4 s, on the desk: away, left, up, m."""


class Hands(Device):
    """Both hands go the same way, with the dead-man held from 50 ms on; the right one closes its jaw."""

    @property
    def ports(self):
        found = []
        for side in ("right", "left"):
            found.append(Port(name=f"{side}/pose", causality="output", type=POSE, max_age_ns=100_000_000))
            found.append(
                Port(
                    name=f"{side}/buttons",
                    causality="output",
                    type="sensor_msgs/msg/Joy",
                    variability="event",
                )
            )
        return tuple(found)

    def open(self, directory):
        self.pressed = False

    def read(self, t):
        x, y, z = WAY * np.clip((t - 100_000_000) / 300_000_000, 0.0, 1.0)
        pose = PoseStamped(header=Header(stamp=Time.from_ns(t)), pose=Pose(position=Point(x=x, y=y, z=z)))
        samples = [Sample(f"{side}/pose", pose) for side in ("right", "left")]
        if t >= 50_000_000 and not self.pressed:
            self.pressed = True
            samples += [
                Sample("right/buttons", Joy(buttons=[1, 1])),
                Sample("left/buttons", Joy(buttons=[1, 0])),
            ]
        return samples

    def close(self):
        pass


class Watcher(Stepped):
    """Sees where the tips are, and pauses PSM2 at 0.25 s."""

    params_model = Params

    @property
    def ports(self):
        watched = [Port(name=name, causality="input", type=POSE) for name in ("right", "left")]
        told = [
            Port(name=name, causality="input", type="std_msgs/msg/String", variability="event")
            for name in ("right_state", "left_state")
        ]
        jaw = Port(
            name="jaw",
            causality="input",
            type="sensor_msgs/msg/JointState",
            fields=("position", "velocity", "effort"),
        )
        order = Port(
            name="order", causality="output", type="crtk_msgs/msg/StringStamped", variability="event"
        )
        return (*watched, *told, jaw, order)

    def configure(self, setup):
        self.seen, self.states, self.jaw = {"right": [], "left": []}, {"right": [], "left": []}, []
        return {"order": ()}

    def step(self, t, h, inputs):
        for side in ("right", "left"):
            self.seen[side].append(inputs[side].copy())
            self.states[side] += [message.data for message in inputs.events(f"{side}_state")]
        self.jaw.append(float(inputs["jaw"][0]))
        return {"order": (StringStamped(string="pause"),) if t == 250_000_000 else ()}

    def state_hash(self):
        return 0

    def close(self):
        pass


@pytest.fixture(scope="module")
def watched():
    common = {
        "view": "camera",
        "tip_frame": "view",
        "instrument": "400006",
        "engage": "held",
        "scale": SCALE,
        "orientation": "follow",
    }
    participants = {
        "hands": Hands("hands", Params()),
        "right": Teleoperation("right", TeleoperationParams.model_validate(common | {"arm": "PSM1"})),
        "left": Teleoperation("left", TeleoperationParams.model_validate(common | {"arm": "PSM2"})),
        "motion": MotionController(
            "motion",
            MotionParams.model_validate(
                {"mounting": "cart", "initial_state": "homed", "arms": ARMS, "publish_period": "2 ms"}
            ),
        ),
        "robot": MujocoEngine(
            "robot",
            MujocoParams.model_validate(
                {"mounting": "cart", "arms": ARMS, "looks": False, "publish_period": "2 ms"}
            ),
        ),
        "watcher": Watcher("watcher", Params()),
    }
    connections = [
        "motion.drive/* -> robot.*",
        "robot.* -> motion.sense/*",
        "watcher.order -> motion.PSM2/state_command",
        "motion.PSM1/jaw/measured_js -> watcher.jaw",
    ]
    for side, arm in (("right", "PSM1"), ("left", "PSM2")):
        connections += [
            f"hands.{side}/pose -> {side}.master",
            f"hands.{side}/buttons -> {side}.buttons",
            f"{side}.{arm}/* -> motion.{arm}/*",
            f"motion.{arm}/setpoint_js -> {side}.measured_js",
            f"motion.{arm}/jaw/setpoint_js -> {side}.jaw/measured_js",
            f"motion.{arm}/operating_state -> {side}.operating_state",
            f"motion.SUJ/{arm}/measured_cp -> {side}.base_in_view",
            f"motion.{arm}/measured_cp -> watcher.{side}",
            f"{side}.state -> watcher.{side}_state",
        ]
    scenario = {
        "name": "console",
        "step": "2 ms",
        "duration": "600 ms",
        "order": ["right", "left", "motion", "robot", "watcher"],
        "connections": connections,
    }
    summary = run_in_process(scenario, participants)
    assert summary.state == "done"
    return participants["watcher"]


@pytest.mark.parametrize("name", ["palpation-probe", "400006", "ROLLING_NEEDLE_DRIVER", "MUSHA_HAND"])
def test_an_instrument_is_led_without_a_motion_controller_as_well(name):
    hands = Hands("hands", Params())
    teleoperation = Teleoperation("teleop", TeleoperationParams.model_validate({"instrument": name}))
    robot = MujocoEngine(
        "robot",
        MujocoParams.model_validate(
            {"arms": {"PSM1": {"instrument": name}}, "looks": False, "publish_period": "2 ms"}
        ),
    )
    ports = {port.name for port in teleoperation.ports}
    connections = [
        "hands.right/pose -> teleop.master",
        "teleop.servo_jp -> robot.PSM1/servo_jp",
        "robot.PSM1/measured_js -> teleop.measured_js",
    ]
    connections += [
        "robot.PSM1/tip_wrench -> teleop.tip_wrench",
        "robot.PSM1/rigid_wrench -> teleop.rigid_wrench",
    ]
    if "jaw/servo_jp" in ports:
        connections += [
            "teleop.jaw/servo_jp -> robot.PSM1/jaw/servo_jp",
            "robot.PSM1/jaw/measured_js -> teleop.jaw/measured_js",
        ]
    scenario = {
        "name": "direct",
        "step": "2 ms",
        "duration": "20 ms",
        "order": ["teleop", "robot"],
        "connections": connections,
    }
    assert run_in_process(scenario, {"hands": hands, "teleop": teleoperation, "robot": robot}).state == "done"


def test_a_view_without_a_camera_is_refused():
    """What is not told, or told in another frame than the camera's, would turn the hand's ways anywhere."""
    hands = Hands("hands", Params())
    teleoperation = Teleoperation("teleop", TeleoperationParams.model_validate({"view": "camera"}))
    motion = MotionController("motion", MotionParams.model_validate({"arms": {"PSM1": {}}}))
    robot = MujocoEngine("robot", MujocoParams.model_validate({"arms": {"PSM1": {}}, "looks": False}))
    participants = {"hands": hands, "teleop": teleoperation, "motion": motion, "robot": robot}
    connections = [
        "hands.right/pose -> teleop.master",
        "motion.drive/* -> robot.*",
        "robot.* -> motion.sense/*",
    ]
    scenario = {"name": "blind", "step": "1 ms", "duration": "2 ms", "connections": connections}
    with pytest.raises(ScenarioError, match=r"base_in_view.* is not connected"):
        run_in_process(scenario, participants)
    connections.append("motion.SUJ/PSM1/measured_cp -> teleop.base_in_view")
    with pytest.raises(ScenarioError, match=r"'PSM1_base', 'teleop\.base_in_view' takes frame 'ECM'"):
        run_in_process(scenario, participants)


def test_the_tip_goes_the_way_of_the_hand_in_the_picture(watched):
    """The camera's frame has x to the left, y up and z ahead; the servos follow to within a fifth of a
    millimetre.
    """
    away, left, up = WAY
    moved = watched.seen["right"][-1] - watched.seen["right"][20]
    assert np.allclose(moved[:3], SCALE * np.array([left, up, away]), atol=2e-4)
    assert watched.states["right"] == ["DISABLED", "CLUTCHED", "ENABLED"][-len(watched.states["right"]) :]


def test_an_arm_that_is_paused_stays_while_the_other_one_goes_on(watched):
    held = np.array(watched.seen["left"])[150:, :3]
    # the other one has half of its way to go
    assert np.ptp(held, axis=0).max() < 0.1 * SCALE * 0.5 * np.abs(WAY).max()
    assert watched.states["left"][-2:] == ["ENABLED", "DISABLED"]


def test_the_jaw_closes_at_the_rate_of_the_ghost(watched):
    """36 degrees a second from 50 ms on, until it has caught up with the button."""
    rate = np.degrees(watched.jaw[150] - watched.jaw[100]) / 0.1
    assert rate == pytest.approx(-36.0, abs=2.0)
