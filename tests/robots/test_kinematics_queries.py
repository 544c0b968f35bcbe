import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots import rotation
from robots.dvrk import arms
from robots.dvrk.cannula import Cannula
from robots.dvrk.kinematics_queries import KinematicsQueries
from schemas.errors import MotionError

PSM, ECM = arms.chain("PSM1"), arms.chain("ECM")
HOME = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])
SHARE = st.floats(0.02, 0.98)


def inside(chain, shares):
    return chain.lower + np.array(shares) * (chain.upper - chain.lower)


def matrix(pose):
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation.matrix(pose[3:]), pose[:3]
    return frame


@given(st.lists(SHARE, min_size=6, max_size=6), st.floats(0.061, 0.239))
def test_forward_is_the_chain_s_own_and_inverse_leads_back_past_the_cannula(shares, insertion):
    q = inside(PSM, shares)
    q[2] = insertion
    cp, result, message = KinematicsQueries(PSM).forward(q)
    assert result
    assert not message
    assert np.allclose(matrix(cp), PSM.forward(q), atol=1e-12)
    answer = KinematicsQueries(PSM).inverse(cp, q)
    assert answer.result
    assert np.allclose(PSM.forward(answer.value), PSM.forward(q), atol=1e-9)


@pytest.mark.parametrize(
    ("chain", "q"), [(PSM, [0.3, -0.2, 0.15, 0.5, -0.4, 0.25]), (ECM, [0.4, 0.3, 0.1, -0.5])]
)
def test_of_fewer_joints_the_link_is_given_with_the_tip_s_offset(chain, q):
    queries = KinematicsQueries(chain)
    for m in range(1, len(q) + 1):
        link = np.eye(4)
        for joint, position in zip(chain.joints[:m], q, strict=False):
            link = link @ joint.transform(position)
        assert np.allclose(matrix(queries.forward(np.array(q[:m])).value), link @ chain.tip, atol=1e-12)
    assert queries.forward(np.zeros(0)).value.tolist() == [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]


def test_forward_answers_in_the_reference_and_inverse_is_asked_in_the_base_frame():
    queries, base = KinematicsQueries(PSM), np.array([0.1, 0.2, 0.3, 0.0, 0.0, np.sin(0.4), np.cos(0.4)])
    local, seen = queries.forward(HOME).value, queries.forward(HOME, base).value
    assert np.allclose(matrix(seen), matrix(base) @ matrix(local), atol=1e-12)
    assert np.allclose(queries.inverse(local, HOME + 0.01).value, HOME, atol=1e-9)


def test_inverse_takes_the_solution_nearest_to_the_positions_it_is_given():
    queries, q = KinematicsQueries(PSM), np.array([0.1, 0.1, 0.12, 3.0, 0.2, 0.1])
    cp = queries.forward(q).value
    for turn in (0.0, -2 * np.pi):
        near = q + np.array([0, 0, 0, turn, 0, 0])
        assert np.allclose(queries.inverse(cp, near).value, near, atol=1e-9)


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (KinematicsQueries(PSM).forward(np.zeros(7)), "too many joints: 7, allowed are up to 6"),
        (KinematicsQueries(PSM).forward(np.array([0.0, np.nan])), "not all joint positions are finite"),
        (
            KinematicsQueries(PSM).inverse(np.array([0, 0, -0.1, 0, 0, 0, 1.0]), np.zeros(5)),
            "incorrect number of joints: 5, expected 6",
        ),
        (
            KinematicsQueries(PSM).inverse(np.array([0, 0, -0.9, 0, 0, 0, 1.0]), HOME),
            "inverse kinematics failed: pose cannot be reached",
        ),
        (
            KinematicsQueries(PSM).inverse(np.array([0, 0, -0.1, 0, 0, 0, 0.0]), HOME),
            "inverse kinematics failed: quaternion",
        ),
        (
            KinematicsQueries(PSM).inverse(np.array([0, 0, np.nan, 0, 0, 0, 1.0]), HOME),
            "inverse kinematics failed: a pose",
        ),
        (
            KinematicsQueries(PSM).inverse(
                KinematicsQueries(PSM).forward(HOME - [0, 0, 0.07, 0, 0, 0]).value, HOME
            ),
            "inverse kinematics failed: the end of",
        ),
    ],
)
def test_what_has_no_answer_says_why_in_the_real_system_s_words(answer, message):
    assert not answer.result
    assert answer.message.startswith(message)


def at(insertion, chain=PSM):
    return np.array([0.0, 0.0, insertion, 0.0, 0.0, 0.0])[: len(chain.joints)]


@pytest.mark.parametrize(
    ("chain", "start", "safe"),
    [
        (PSM, 0.0156 + 0.043, 0.0156 + 0.045),
        (arms.chain("PSM1", "420006"), 0.0078, 0.0098),
        (ECM, 0.05, 0.04),
    ],
)
def test_cartesian_control_begins_past_the_cannula_and_goes_no_nearer(chain, start, safe):
    rule = Cannula.of(chain)
    assert rule.not_past(at(start - 0.9e-6, chain)) == ""
    assert "insert it in joint space first" in rule.not_past(at(start - 1.1e-6, chain))
    rule.check(at(safe - 0.9e-6, chain), at(0.1, chain))
    with pytest.raises(MotionError, match=r"(\S+) m past the remote centre, allowed from (?!\1 )"):
        rule.check(at(safe - 1.1e-6, chain), at(0.1, chain))
    rule.check(at(safe - 1e-3, chain), at(safe - 1e-3, chain))  # nearer than that, but no nearer than it is
