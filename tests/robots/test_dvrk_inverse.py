from math import radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.dvrk import arms, ecm
from robots.dvrk.instruments import instruments
from robots.dvrk.inverse import ORIENTATION_TOLERANCE, inverse
from robots.serial_chain import Joint
from schemas.errors import MotionError

CASES = [
    ("PSM1", "400006"),
    ("PSM2", "420006"),
    ("PSM3", "400205"),
    ("ECM", "straight"),
    ("ECM", "up"),
    ("ECM", "down"),
    ("PSM1", "MUSHA_HAND"),
]
PSM, ECM = arms.chain("PSM1", "400006"), arms.chain("ECM")
HOME = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])
LOOK = np.array([0.1, -0.2, 0.12, 0.3])


def random_configurations(chain, count, seed=0):
    return np.random.default_rng(seed).uniform(chain.lower, chain.upper, (count, len(chain.joints)))


def configurations(chain):
    return st.tuples(*(st.floats(joint.lower, joint.upper) for joint in chain.joints)).map(np.array)


@pytest.mark.parametrize(("arm", "tool"), CASES)
def test_there_and_back_ten_thousand_times(arm, tool):
    chain = arms.chain(arm, tool)
    q, near = random_configurations(chain, 10_000), random_configurations(chain, 10_000, seed=1)
    found = inverse(chain, chain.forward(q), near)
    assert ((chain.lower <= found) & (found <= chain.upper)).all()
    assert np.allclose(chain.forward(found), chain.forward(q), rtol=0.0, atol=1e-9)


def test_every_instrument_with_a_wrist_of_three_joints_is_solved():
    for name in (name for name, one in instruments().items() if not one.has_snake_wrist):
        chain = arms.chain("PSM1", name)
        q = random_configurations(chain, 50)
        there = chain.forward(inverse(chain, chain.forward(q), q))
        assert np.allclose(there, chain.forward(q), rtol=0.0, atol=1e-12), name


@pytest.mark.parametrize(("arm", "tool"), CASES)
def test_the_solution_is_the_one_at_hand(arm, tool):
    chain = arms.chain(arm, tool)
    q = random_configurations(chain, 1000)
    assert np.allclose(inverse(chain, chain.forward(q), q), q, rtol=0.0, atol=1e-9)


@pytest.mark.long
@settings(max_examples=200)
@given(configurations(PSM), configurations(PSM))
def test_the_psm_comes_back_from_everywhere(q, near):
    try:
        found = inverse(PSM, PSM.forward(q), near)
    except (
        MotionError
    ):  # only where an axis passes the RCM, and the one solution of many that is near does not fit
        wrist = PSM.frames(q)[4:6, :3, 3]
        assert np.linalg.norm(wrist, axis=1).min() < 2e-9
        return
    assert np.allclose(PSM.forward(found), PSM.forward(q), rtol=0.0, atol=3e-9)


def test_many_poses_give_what_each_gives_alone():
    q = random_configurations(PSM, 12)
    poses = PSM.forward(q).reshape(3, 4, 4, 4)
    found = inverse(PSM, poses, HOME)
    assert found.shape == (3, 4, 6)
    assert np.allclose(
        found.reshape(12, 6),
        [inverse(PSM, pose, HOME) for pose in poses.reshape(12, 4, 4)],
        rtol=0.0,
        atol=1e-12,
    )


def test_singular_poses_change_no_bit_of_those_beside_them():
    pitch_axis, yaw_axis = 0.4318 - 0.4162, 0.4318 - 0.4162 - 0.0091  # insertions at which they pass the RCM
    q = random_configurations(PSM, 12)
    singular = np.array([[0.3, -0.2, pitch_axis, 0.5, -0.4, 0.25], [0.3, -0.2, yaw_axis, 0.5, 0.0, 0.25]])
    both = np.concatenate([singular, q])
    together = inverse(PSM, PSM.forward(both), both)
    assert together[2:].tobytes() == inverse(PSM, PSM.forward(q), q).tobytes()
    assert np.allclose(together, both, atol=1e-9)


def test_roll_goes_the_short_way_inside_its_range():
    roll = 2.5  # also at 2.5 - 2 pi
    pose = PSM.forward(np.add(HOME, [0, 0, 0, roll, 0, 0]))
    for near, expected in ((3.0, roll), (-3.0, roll - 2 * np.pi), (0.0, roll)):
        assert inverse(PSM, pose, np.add(HOME, [0, 0, 0, near, 0, 0]))[3] == pytest.approx(expected)
    pose = PSM.forward(np.add(HOME, [0, 0, 0, 1.0, 0, 0]))
    # 1 - 2 pi is out of range
    assert inverse(PSM, pose, np.add(HOME, [0, 0, 0, -4.5, 0, 0]))[3] == pytest.approx(1.0)


def test_where_the_wrist_pitch_axis_passes_the_rcm_the_shaft_stays():
    through = 0.4318 - 0.4162
    q = np.array([0.3, -0.2, through, 0.5, -0.4, 0.25])
    assert np.allclose(inverse(PSM, PSM.forward(q), q), q, atol=1e-9)
    for beside in (through - 1e-12, through + 1e-12, through + 1e-7):
        q[2] = beside
        found = inverse(PSM, PSM.forward(q), q)
        assert np.allclose(PSM.forward(found), PSM.forward(q), rtol=0.0, atol=1e-9)


def test_where_the_wrist_yaw_axis_passes_the_rcm_the_wrist_yaw_stays():
    q = np.array([0.3, -0.2, 0.4318 - 0.4162 - 0.0091, 0.5, 0.0, 0.25])
    assert np.linalg.norm(PSM.forward(q)[:3, 3]) < 1e-15
    assert np.allclose(inverse(PSM, PSM.forward(q), q), q, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ([0, 0, 0.2, 0, 0, 0], r"cannot be reached: joint insertion at 0.32 m, allowed are 0 .. 0.24$"),
        ([0, 1.0, 0, 0, 0, 0], "joint pitch at 1 rad, allowed are -0.925025 .. 0.925025$"),
        ([0, 0, 0, 0, -1.5, 0], "joint wrist_pitch at -1.5 rad, allowed are -1.39626 .. 1.39626$"),
        ([0, 0, 0, 0, 0, 1.5], "joint wrist_yaw at 1.5 rad, allowed are -1.39626 .. 1.39626$"),
        ([1.65, 0, 0, 0, 0, 0], "joint yaw at 1.65 rad, allowed are -1.588 .. 1.588$"),
    ],
)
def test_a_pose_out_of_reach_names_the_joint_and_its_range(change, reason):
    with pytest.raises(MotionError, match=reason):
        inverse(PSM, PSM.forward(HOME + change), HOME)


def test_of_many_poses_the_first_out_of_reach_is_named():
    poses = PSM.forward(np.add(HOME, [[0, 0, 0, 0, 0, 0], [0, 0, 0.2, 0, 0, 0], [0, 0, 0.3, 0, 0, 0]]))
    with pytest.raises(MotionError, match=r"pose 1 cannot be reached: joint insertion at 0.32 m"):
        inverse(PSM, poses, HOME)


@pytest.mark.parametrize(("chain", "near"), [(PSM, HOME), (ECM, LOOK)])
def test_what_is_not_finite_is_refused(chain, near):
    pose = chain.forward(near)
    pose[1, 3] = np.nan
    with pytest.raises(MotionError, match="not finite"):
        inverse(chain, pose, near)


MIRROR = np.diag([1.0, 1.0, -1.0, 1.0])
SEVERAL = np.broadcast_to(np.eye(4), (2, 4, 4))


@pytest.mark.parametrize(
    ("pose", "near", "reason"),
    [
        (np.eye(3), HOME, r"pose of shape \(3, 3\), expected \(..., 4, 4\)"),
        (np.zeros(6), HOME, r"pose of shape \(6,\), expected"),
        (np.eye(4), HOME[:4], r"`near` of shape \(4,\), expected \(6,\): yaw, pitch"),
        (np.eye(4), 0.0, r"`near` of shape \(\), expected \(6,\): yaw, pitch"),
        (SEVERAL, np.zeros((3, 6)), r"`near` of shape \(3, 6\), expected \(6,\) or \(2, 6\): yaw, pitch"),
        (np.eye(4), HOME + np.inf, "not finite"),
        (np.eye(4) + 1e300 * np.eye(4, k=3), HOME, "more than 1000 m away"),
        (MIRROR, HOME, "is no rigid transform: .*rotation matrix"),
        (np.eye(4) * 2.0, HOME, "is no rigid transform"),
        (np.stack([PSM.forward(HOME), np.zeros((4, 4))]), HOME, "pose 1 is no rigid transform"),
    ],
)
def test_what_is_no_pose_or_no_configuration_is_refused_with_what_is_one(pose, near, reason):
    with np.errstate(invalid="ignore"), pytest.raises(MotionError, match=reason):
        inverse(PSM, pose, near)


@pytest.mark.parametrize(("arm", "tool"), [("SUJ/PSM1", None), ("PSM1", "400117")])
def test_chains_of_another_kind_are_refused(arm, tool):
    chain = arms.chain(arm, tool)
    with pytest.raises(MotionError, match="no closed form for the joints"):
        inverse(chain, np.eye(4), np.zeros(len(chain.joints)))


def test_the_endoscope_takes_a_step_aside_with_the_orientation_nearest_to_the_one_asked_for():
    pose = ECM.forward(LOOK)
    pose[:3, 3] += [0.01, -0.005, 0.0]
    q = inverse(ECM, pose, LOOK)
    reached = ECM.forward(q)
    assert np.allclose(reached[:3, 3], pose[:3, 3], rtol=0.0, atol=1e-12)

    def apart(roll):
        other = q.copy()
        other[3] = roll
        return np.linalg.norm(ECM.forward(other)[:3, :3] - pose[:3, :3])

    assert apart(q[3]) < min(apart(q[3] - 1e-3), apart(q[3] + 1e-3))


def test_an_orientation_that_the_endoscope_cannot_have_is_refused():
    turn = np.eye(4)
    for angle, refused in ((ORIENTATION_TOLERANCE, False), (ORIENTATION_TOLERANCE + 2e-5, True)):
        turn[:3, :3] = Joint("", "revolute", angle, 0.0, 0.0, 0.0, 0.0, 0.0).transform(0.0)[:3, :3]
        pose = ECM.forward(LOOK) @ turn
        if refused:
            with pytest.raises(
                MotionError, match=r"orientation 45.001 degrees away at this position, allowed are 45;"
            ):
                inverse(ECM, pose, LOOK)
        else:
            assert np.allclose(inverse(ECM, pose, LOOK), LOOK, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("endoscope", ["straight", "up", "down"])
@pytest.mark.parametrize("tip_frame", ["kinematic", "view"])
def test_the_endoscope_makes_the_moves_of_the_arm_test_of_dvrk_python(endoscope, tip_frame):
    """dvrk_arm_test.py -a ECM: goals along x and y, with the orientation of the pose where it starts."""
    chain = ecm.chain(endoscope, tip_frame)
    start = np.array(ecm.HOME)
    servo = 0.02 * (1.0 - np.cos(np.linspace(0.0, 2.0 * np.pi, 500)))
    ways = [(x, x) for x in servo] + [(-0.05, 0.0), (0.05, 0.0), (0.0, -0.05), (0.0, 0.05)]
    goals = np.tile(chain.forward(start), (len(ways), 1, 1))
    goals[:, :2, 3] += ways
    reached = chain.forward(inverse(chain, goals, start))
    assert np.allclose(reached[:, :3, 3], goals[:, :3, 3], rtol=0.0, atol=1e-12)


def test_the_endoscope_accepts_30_degrees_and_refuses_axes_that_are_swapped():
    away = np.eye(4)
    away[:3, :3] = Joint("", "revolute", radians(30.0), 0.0, 0.0, 0.0, 0.0, 0.0).transform(0.0)[:3, :3]
    assert np.allclose(inverse(ECM, ECM.forward(LOOK) @ away, LOOK), LOOK, rtol=0.0, atol=1e-9)
    swapped = ECM.forward(LOOK)
    swapped[:3, :3] = swapped[:3, :3] @ [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    with pytest.raises(MotionError, match="90 degrees away at this position, allowed are 45;"):
        inverse(ECM, swapped, LOOK)


def test_a_pose_at_a_limit_that_was_computed_from_degrees_is_reached():
    """The wrist's limit is 1.39626 rad, 80 degrees are 3 urad more."""
    q = np.array([0.0, 0.0, 0.12, 0.0, radians(80.0), radians(-80.0)])
    assert np.abs(inverse(PSM, PSM.forward(q), q) - q).max() < 1e-5
    beyond = q.copy()
    beyond[4] = 1.39636
    with pytest.raises(MotionError, match=r"wrist_pitch at 1.39636 rad, allowed are -1.39626 .. 1.39626"):
        inverse(PSM, PSM.forward(beyond), beyond)
