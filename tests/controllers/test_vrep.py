"""The authors' topics, stepped by hand: a robot that is exactly where it is told to be."""

import numpy as np
import pytest

from controllers.vrep import VrepScene, VrepSceneParams
from devices.ros.params import GatewayParams
from devices.ros.topics.vrep_table import vrep_table
from hub.testing import Driver, check_engine
from robots.dvrk import setup_joints
from schemas.errors import StateError
from schemas.ros import BoolMessage, JointState, StringMessage

H = 5_000_000
ARMS = {"PSM1": {"instrument": "400006", "jaw": 0.5}, "PSM2": {"instrument": "400006"}, "ECM": {}}
DRIVEN = ("PSM1", "PSM2", "ECM", "PSM1/jaw", "PSM2/jaw")


class Rig:
    def __init__(self):
        self.paper = VrepScene("paper", VrepSceneParams.model_validate({"arms": ARMS}))
        self.driver = Driver(self.paper, period_ns=H)

    outputs = property(lambda self: self.driver.outputs)

    def step(self, events=()):
        for port, message in dict(events).items():
            self.driver.send(port, message)
        for arm in DRIVEN:
            command = self.outputs[f"{arm}/servo_jp"]
            self.driver.values[f"{arm}/measured_js"][: command.size] = command
        self.driver.step()
        return self

    def state(self, topic):
        return self.outputs[f"dvrk/{topic}"].tolist()


def jp(*values):
    return JointState(position=np.array(values, np.float64))


def test_every_topic_of_the_table_is_a_port_of_the_same_type_and_size():
    there = {port.name: port for port in Rig().paper.ports}
    heard_only = ("stereo/", "suture_planner/", "dvrk/setup_joint/robot_state", "kalmanOutput", "Tcn_hat")
    for row in vrep_table(GatewayParams.model_validate({"profile": "vrep", "arms": ARMS})):
        if row.port is not None and not row.port.name.startswith(heard_only):
            port = there[row.port.name]
            assert (port.type, port.variability, port.size, port.fields) == (
                row.type,
                row.port.variability,
                row.port.size,
                row.port.fields,
            ), row.topic
            assert (port.causality == "output") is (row.way == "publish")


@pytest.mark.parametrize("topic", ["state_joint_desired", "set_position_joint", "set_position_goal_joint"])
def test_desired_positions_go_straight_to_the_joints(topic):
    rig = Rig().step(
        {f"dvrk/PSM1/{topic}": jp(0.3, -0.2, 0.1, 0.4, 0.5, 0.6), f"dvrk/ECM/{topic}": jp(0.1, 0.2, 0.1, 0.3)}
    )
    assert rig.outputs["PSM1/servo_jp"].tolist() == [0.3, -0.2, 0.1, 0.4, 0.5, 0.6]
    assert rig.step().state("PSM1/state_joint_current") == [0.3, -0.2, 0.1, 0.4, 0.5, 0.6] + [0.0] * 6
    assert rig.state("ECM/state_joint_current")[:4] == [0.1, 0.2, 0.1, 0.3]


def test_the_last_joint_of_psm2_is_scaled():
    rig = Rig().step({"dvrk/PSM2/state_joint_desired": jp(0.0, 0.0, 0.1, 0.0, 0.0, 0.5)})
    assert rig.outputs["PSM2/servo_jp"][5] == pytest.approx(0.8212 * 0.5)
    assert rig.step().state("PSM2/state_joint_current")[5] == pytest.approx(0.5)


def test_the_jaw_is_told_in_units_of_0_4106_rad_of_half_its_opening():
    rig = Rig()
    assert rig.state("PSM1/state_jaw_current") == pytest.approx([0.25 / 0.4106])  # at the start alone
    assert rig.step().state("PSM1/state_jaw_current") == pytest.approx([0.25])
    rig.step({"dvrk/PSM1/state_jaw_desired": jp(1.0), "dvrk/PSM2/state_jaw_desired": jp(-1.0)}).step()
    assert rig.outputs["PSM1/jaw/servo_jp"].tolist() == pytest.approx([0.8212])
    assert rig.state("PSM1/state_jaw_current") == pytest.approx([0.4106])
    assert rig.outputs["PSM2/jaw/servo_jp"].tolist() == [0.0]


def test_a_needle_is_released_by_opening_the_jaws():
    rig = Rig().step({"dvrk/PSM1/state_jaw_desired": jp(0.0)})
    assert rig.step({"release_needle": BoolMessage(data=False)}).outputs["PSM1/jaw/servo_jp"].tolist() == [
        0.0
    ]
    assert rig.step({"release_needle": BoolMessage(data=True)}).outputs[
        "PSM1/jaw/servo_jp"
    ].tolist() == pytest.approx([0.8212])


def test_words_are_echoed():
    rig = Rig().step()
    assert [message.data for message in rig.outputs["dvrk/PSM1/current_state"]] == ["READY"]
    assert [message.data for message in rig.outputs["dvrk/PSM2/robot_state"]] == ["uninitialized"]
    rig.step({"dvrk/PSM2/set_robot_state": StringMessage(data="Home")})
    assert [message.data for message in rig.outputs["dvrk/PSM2/robot_state"]] == ["Home"]
    assert rig.outputs["dvrk/PSM1/current_state"] == ()


def test_setup_joints_stand_right_left_camera():
    expected = [
        *setup_joints.SIMULATED["PSM1"][:5],
        *setup_joints.SIMULATED["PSM2"][:5],
        *setup_joints.SIMULATED["ECM"][:4],
    ]
    assert Rig().state("setup_joint/state_joint_current") == expected


def test_positions_out_of_range_are_cut_and_what_is_none_is_dropped():
    rig = Rig()
    before = rig.outputs["PSM1/servo_jp"].tolist()
    assert (
        rig.step({"dvrk/PSM1/state_joint_desired": jp(1.0, 2.0)}).outputs["PSM1/servo_jp"].tolist() == before
    )
    assert (
        rig.step({"dvrk/PSM1/state_joint_desired": jp(9.0, 0, 0.1, 0, 0, 0)}).outputs["PSM1/servo_jp"][0]
        < 2.0
    )


def test_it_is_a_participant_whose_state_can_be_saved():
    check_engine(lambda: VrepScene("paper", VrepSceneParams.model_validate({"arms": ARMS})), period_ns=H)
    with pytest.raises(StateError, match="participant 'paper': a saved state of 1 bytes"):
        Rig().paper.restore(b"0")
