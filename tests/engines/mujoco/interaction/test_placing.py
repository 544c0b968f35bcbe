"""Objects that are put in place, soft tables, and sub-steps in one call."""

import numpy as np
import pytest

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.participant import Inputs, Setup
from schemas.ros import Header, Point, Pose, PoseStamped, Quaternion

PERIOD = 10_000_000
SCENE = {
    "looks": False,
    "arms": {"PSM1": {"instrument": "LARGE_NEEDLE_DRIVER_400006", "position": [0, 0, 0.2]}},
    "table": {"position": [0, 0, 0], "size": [0.2, 0.2, 0.01]},
    "objects": {
        "needle": {"kind": "needle", "position": [0, 0, 0.4e-3]},
        "block": {"kind": "block", "position": [0.05, 0, 10.25e-3]},
    },
    "publish_period": "10 ms",
}
STARTS = {
    "PSM1/servo_jp": [0.0, 0.0, 0.12, 0.0, 0.0, 0.0],
    "PSM1/servo_jf": np.zeros(6),
    "PSM1/control_mode": [1.0, 1.0],
    "PSM1/jaw/servo_jp": [0.0],
    "PSM1/jaw/servo_jf": [0.0],
}


def stepped(count, events=None, insertion=0.12, **params):
    """Return the engine and its outputs after `count` steps; `events` come with the first."""
    engine = MujocoEngine("robot", MujocoParams.model_validate({**SCENE, **params}))
    outputs = engine.configure(Setup(PERIOD, None))
    for i in range(count):
        values = {port: np.array(value, float) for port, value in STARTS.items()}
        values["PSM1/servo_jp"][2] = insertion
        inputs = Inputs(values, events=events if i == 0 else {})
        outputs = engine.step(i * PERIOD, PERIOD, inputs)
    return engine, outputs


def at(x, y, z):
    pose = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=1.0))
    return (PoseStamped(header=Header(frame_id="world"), pose=pose),)


def test_an_object_that_is_placed_stays_there():
    _, outputs = stepped(10, {"needle/place": at(0.03, -0.02, 0.4e-3)})
    assert outputs["needle/pose"] == pytest.approx([0.03, -0.02, 0.4e-3, 0, 0, 0, 1], abs=1e-4)
    assert outputs["block/pose"][:3] == pytest.approx([0.05, 0.0, 10.25e-3], abs=1e-4)


def test_sub_steps_in_one_call_have_the_same_bits():
    watched, _ = stepped(20, {"block/place": at(0.05, 0.0, 0.03)})
    quick, outputs = stepped(20, {"block/place": at(0.05, 0.0, 0.03)}, rigid_wrench=False)
    assert quick.state_hash() == watched.state_hash()
    assert "PSM1/rigid_wrench" not in outputs


def test_instruments_reach_into_a_soft_table_on_which_things_lie():
    soft = {**SCENE["table"], "soft": True}
    _, into = stepped(60, insertion=0.21, table=soft)
    _, onto = stepped(60, insertion=0.21)
    assert onto["PSM1/measured_cp"][2] + 0.2 > 9e-3  # the jaw is 10.2 mm long
    assert into["PSM1/measured_cp"][2] + 0.2 < -1e-3
    assert into["block/pose"][2] == pytest.approx(10.25e-3, abs=1e-4)
