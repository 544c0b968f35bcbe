import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engines.mujoco.model import build, probe_body
from engines.mujoco.params import MujocoParams
from robots import rotation
from robots.dvrk import psm

ORIENTATION = rotation.exp(np.array([0.3, -0.5, 0.7]))
POSITION = np.array([0.1, -0.2, 0.3])
PARAMS = MujocoParams.model_validate(
    {"arms": {"PSM1": {"position": POSITION.tolist(), "orientation": ORIENTATION.tolist()}, "PSM2": {"probe_radius": "4 mm", "position": [0.5, 0, 0]}}}
)
CHAIN = PARAMS.arms["PSM1"].chain
MODEL = build(PARAMS)
configurations = st.tuples(*(st.floats(joint.lower, joint.upper) for joint in CHAIN.joints)).map(np.array)


def placed(q):
    data = mujoco.MjData(MODEL)
    data.qpos[:6] = q
    mujoco.mj_forward(MODEL, data)
    return data


def inertia(q):
    matrix = np.zeros((MODEL.nv, MODEL.nv))
    mujoco.mj_fullM(MODEL, placed(q), matrix)
    return matrix


@settings(max_examples=50)
@given(configurations)
def test_kinematics_are_those_of_the_dh_table(q):
    tip = placed(q).site("PSM1/tip")
    expected = CHAIN.forward(q)
    base = rotation.matrix(ORIENTATION)
    assert np.allclose(tip.xpos, POSITION + base @ expected[:3, 3], atol=1e-9)
    assert np.allclose(tip.xmat.reshape(3, 3), base @ expected[:3, :3], atol=1e-9)


def test_the_centre_of_mass_of_the_probe_is_the_tip():
    data = placed([0.3, -0.2, 0.15, 0.5, -0.4, 0.25])
    body = MODEL.body(probe_body("PSM1")).id
    assert np.allclose(data.xipos[body], data.site("PSM1/tip").xpos, atol=1e-15)


def test_inertia_at_zero_is_the_identified_one():
    diagonal = np.diag(inertia(np.zeros(6)))
    identified = [servo.inertia for servo in psm.SERVO if servo.inertia is not None]
    assert np.allclose(diagonal[:3], identified, rtol=1e-12)
    assert np.allclose(diagonal[6:9], identified, rtol=1e-12)


def test_yaw_inertia_grows_with_insertion_as_identified():
    insertion, growth = psm.YAW_INERTIA_GROWTH
    near, far = (inertia([0, 0, q3, 0, 0, 0])[0, 0] for q3 in (0.0, insertion))
    assert far - near == pytest.approx(growth, rel=0.05)  # the instrument's own links come on top


def test_gravity_is_compensated():
    data = placed([0.5, 0.3, 0.1, 0.2, 0.4, -0.3])
    assert np.allclose(data.qfrc_bias - data.qfrc_passive, 0.0, atol=1e-12)


def test_start_outside_the_joint_range_is_refused():
    with pytest.raises(ValueError, match=r"insertion 0\.3 is out of its range 0 \.\. 0\.24"):
        MujocoParams.model_validate({"arms": {"PSM1": {"start": [0, 0, 0.3, 0, 0, 0]}}})


def test_orientation_must_be_a_unit_quaternion():
    with pytest.raises(ValueError, match="no unit quaternion"):
        MujocoParams.model_validate({"arms": {"PSM1": {"orientation": [1, 1, 0, 0]}}})
