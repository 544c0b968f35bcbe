import re
import sys
from concurrent.futures import ThreadPoolExecutor
from copy import deepcopy
from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots import rotation
from robots.dvrk import arms
from robots.dvrk.instruments import instrument
from robots.serial_chain import Joint, SerialChain
from schemas.errors import MotionError

NAMES = ("PSM1", "ECM", "MTML", "MTMR", "SUJ/PSM3")
CHAINS = {name: arms.chain(name) for name in NAMES}


def configurations(chain):
    return st.tuples(*(st.floats(max(joint.lower, -pi), min(joint.upper, pi)) for joint in chain.joints)).map(
        np.array
    )


def many(chain, count=100):
    return np.random.default_rng(0).uniform(
        np.maximum(chain.lower, -pi), np.minimum(chain.upper, pi), (count, len(chain.joints))
    )


anywhere = st.sampled_from(NAMES).flatmap(
    lambda name: st.tuples(st.just(CHAINS[name]), configurations(CHAINS[name]))
)


@given(configurations(CHAINS["PSM1"]))
def test_forward_kinematics_is_the_product_of_the_links(q):
    chain = CHAINS["PSM1"]
    product = np.eye(4)
    for joint, position in zip(chain.joints, q, strict=True):
        product = product @ joint.transform(position)
    assert np.allclose(chain.forward(q), product @ chain.tip, atol=1e-14)


@given(anywhere)
def test_jacobian_is_the_derivative_of_the_pose(case):
    chain, q = case
    step = 1e-6
    jacobian = chain.jacobian(chain.frames(q))
    for i, dq in enumerate(step * np.eye(len(q))):
        back, ahead = chain.forward(q - dq), chain.forward(q + dq)
        linear = (ahead[:3, 3] - back[:3, 3]) / (2 * step)
        turn = rotation.product(rotation.from_matrix(ahead), rotation.conjugate(rotation.from_matrix(back)))
        assert np.allclose(jacobian[:, i], [*linear, *(rotation.log(turn) / (2 * step))], atol=1e-8)


@given(anywhere)
def test_jacobian_in_the_tip_frame_is_that_of_the_base_turned(case):
    chain, q = case
    frames = chain.frames(q)
    to_base = np.kron(np.eye(2), frames[-1, :3, :3])
    assert np.allclose(to_base @ chain.jacobian(frames, frame="tip"), chain.jacobian(frames), atol=1e-14)


@pytest.mark.parametrize("name", NAMES)
def test_many_configurations_give_what_each_gives_alone(name):
    chain = CHAINS[name]
    q = many(chain)
    frames = chain.frames(q.reshape(10, 10, -1)).reshape(100, -1, 4, 4)
    assert np.allclose(frames, [chain.frames(one) for one in q], atol=1e-14)
    for frame in ("base", "tip"):
        assert np.allclose(
            chain.jacobian(frames, frame=frame),
            [chain.jacobian(chain.frames(one), frame=frame) for one in q],
            atol=1e-14,
        )
    assert np.array_equal(chain.jacobian(frames), [chain.jacobian(one) for one in frames])
    assert np.array_equal(chain.forward(q), frames[:, -1])


def test_the_standard_form_of_the_psm_is_its_modified_form():
    psm = CHAINS["PSM1"]
    rows = [  # alpha, a, d, theta in standard form, after a first turn by Rx(pi/2)
        (-pi / 2, 0.0, 0.0, pi / 2),
        (pi / 2, 0.0, 0.0, -pi / 2),
        (0.0, 0.0, -0.4318, 0.0),
        (-pi / 2, 0.0, 0.4162, 0.0),
        (-pi / 2, 0.0091, 0.0, -pi / 2),
        (0.0, 0.0, 0.0, -pi / 2),
    ]
    joints = [Joint(j.name, j.kind, *row, j.lower, j.upper) for j, row in zip(psm.joints, rows, strict=True)]
    standard = SerialChain.from_standard(joints, instrument("400006").tip)
    upright = Joint("", "revolute", pi / 2, 0.0, 0.0, 0.0, 0.0, 0.0).transform(0.0)
    q = many(psm)
    assert np.allclose(upright @ standard.forward(q), psm.forward(q), atol=1e-15)


def test_standard_form_is_the_product_of_its_own_links():
    joint = Joint("one", "revolute", 0.7, 0.3, 0.2, 0.1, -pi, pi)
    other = Joint("two", "prismatic", -0.4, 0.1, 0.5, 0.6, 0.0, 1.0)

    def link(row, theta, d):
        turn = Joint("", "revolute", 0.0, 0.0, d, theta, 0.0, 0.0).transform(0.0)
        return turn @ Joint("", "revolute", row.alpha, row.a, 0.0, 0.0, 0.0, 0.0).transform(0.0)

    expected = link(joint, 0.1 + 0.9, 0.2) @ link(other, 0.6, 0.5 + 0.4)
    assert np.allclose(
        SerialChain.from_standard([joint, other], np.eye(4)).forward(np.array([0.9, 0.4])),
        expected,
        atol=1e-15,
    )


@pytest.mark.parametrize(
    ("q", "reason"),
    [
        ([0, 0, 0.1, 0, 0], r"shape \(5,\), expected 6: yaw, pitch, insertion, roll, wrist_pitch, wrist_yaw"),
        ([0, 0, np.nan, 0, 0, 0], "not all positions are finite"),
        (
            [0, 1.0, 0.3, 0, 0, 0],
            (
                r"joint pitch at 1 rad, allowed are -0.925025 .. 0.925025; joint insertion at 0.3 m, allowed"
                r" are 0 .. 0.24$"
            ),
        ),
    ],
)
def test_positions_that_cannot_be_are_refused_with_what_can(q, reason):
    with pytest.raises(MotionError, match=reason):
        CHAINS["PSM1"].check(np.array(q, float))


def test_positions_at_the_limits_can_be_and_just_beyond_are_clamped():
    chain = CHAINS["PSM1"]
    for limit, side in ((chain.lower, -1.0), (chain.upper, 1.0)):
        assert (chain.within(limit) == limit).all()
        assert (chain.within(limit + side * 0.99 * chain.tolerance) == limit).all()


@pytest.mark.parametrize("i", range(6))
@pytest.mark.parametrize("beyond", [1.01, 1.5, 10.0])
def test_a_refused_position_is_never_written_as_the_limit(i, beyond):
    chain = CHAINS["PSM1"]
    for limit, side in ((chain.lower, -1.0), (chain.upper, 1.0)):
        q = np.zeros(6)
        q[i] = limit[i] + side * beyond * chain.tolerance[i]
        with pytest.raises(MotionError) as refused:
            chain.within(q)
        at, lower, upper = re.search(
            r"at (\S+) \S+, allowed are (\S+) \.\. (\S+)$", str(refused.value)
        ).groups()
        assert at not in (lower, upper)
        assert not float(lower) <= float(at) <= float(upper)


@pytest.mark.parametrize("call", [CHAINS["PSM1"].forward, CHAINS["PSM1"].frames])
@pytest.mark.parametrize("shape", [(), (5,), (3, 7)])
def test_another_number_of_joints_has_no_pose(call, shape):
    with pytest.raises(MotionError, match="expected 6: yaw, pitch, insertion, roll"):
        call(np.zeros(shape))


def test_a_pose_of_what_is_not_finite_is_refused_naming_the_first():
    q = np.zeros((3, 6))
    q[1, 2] = np.nan
    with (
        np.errstate(invalid="ignore"),
        pytest.raises(MotionError, match=r"\[0.0, 0.0, nan, 0.0, 0.0, 0.0\] of yaw, pitch"),
    ):
        CHAINS["PSM1"].forward(q)


def test_a_copy_of_a_chain_computes_for_itself():
    chain = CHAINS["PSM1"]
    q = np.array([0.1, 0.2, 0.12, 0.1, 0.2, 0.3])
    frames = chain.frames(q)
    copied = deepcopy(chain)
    assert np.array_equal(copied.frames(-q), chain.frames(-q))
    assert np.array_equal(copied.frames(q), frames)


def test_one_configuration_has_the_bits_of_many():
    psm = CHAINS["PSM1"]
    q = many(psm)
    assert psm.frames(q).tobytes() == np.stack([psm.frames(one) for one in q]).tobytes()


def test_threads_that_share_a_chain_do_not_disturb_one_another():
    psm = CHAINS["PSM1"]
    goals = many(psm)[:8]
    expected = [psm.frames(q).tobytes() for q in goals]

    def differs(i):
        return any(psm.frames(goals[i]).tobytes() != expected[i] for _ in range(500))

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(len(goals)) as pool:
            assert not any(pool.map(differs, range(len(goals))))
    finally:
        sys.setswitchinterval(before)
