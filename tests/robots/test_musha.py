import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.dvrk import arms
from robots.dvrk.inverse import inverse
from robots.dvrk.musha import HAND, TROCAR_RADIUS
from schemas.errors import MotionError

LOWER, UPPER = HAND.joints[0].lower, HAND.joints[0].upper
PULLEYS = np.array([phalanx.pulley for phalanx in HAND.phalanges])
closings = st.tuples(*[st.floats(LOWER, UPPER)] * 3).map(np.array)


def test_the_folded_hand_passes_the_trocar_with_its_spheres():
    centres = HAND.contacts(HAND.unloaded(HAND.closings("folded", 0.0)))
    assert (np.hypot(centres[..., 0], centres[..., 1]) + HAND.radius < TROCAR_RADIUS).all()


def test_fingers_of_the_folded_hand_lie_side_by_side():
    tips = HAND.contacts(np.zeros((3, 3)))[:, -1]
    apart = [np.linalg.norm(tips[i] - tips[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    assert min(apart) > 2.0 * HAND.radius


@given(closings)
def test_an_unloaded_finger_has_the_closing_it_is_told(u):
    q = HAND.unloaded(u)
    assert np.allclose(q @ PULLEYS / PULLEYS[0], u, atol=1e-9)
    assert all(p.lower <= q[i, j] <= p.upper for i in range(3) for j, p in enumerate(HAND.phalanges))


@given(closings)
def test_an_unloaded_finger_is_in_balance(u):
    """Where a joint is at no stop, the torque of its tendon is that of its spring."""
    q, tension = HAND.unloaded(u), HAND.effort_of_springs(u) / PULLEYS[0]
    for j, p in enumerate(HAND.phalanges):
        free = (q[:, j] > p.lower + 1e-9) & (q[:, j] < p.upper - 1e-9)
        assert np.allclose((p.pulley * tension - p.stiffness * (q[:, j] - p.rest))[free], 0.0, atol=1e-12)


def test_an_unloaded_finger_turns_as_one_piece_over_the_range_of_its_first_joint():
    first = HAND.phalanges[0]
    u = np.linspace(first.lower, first.upper, 20)
    q = HAND.unloaded(u)
    assert np.allclose(q[:, 0], u)
    assert not q[:, 1:].any()


def test_the_motors_can_close_the_fingers_against_all_springs():
    assert (HAND.effort_of_springs(np.array([UPPER])) < HAND.effort).all()


def test_contacts_are_where_the_links_are():
    """The closed form against the product of the links' transforms."""
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 3))
    found = HAND.contacts(q)
    poses = {"roll": np.eye(4)}
    at_zero = {"roll": np.eye(4), **{link.name: link.pose for link in HAND.links}}
    for i, link in enumerate(HAND.links):
        c, s = np.cos(q.ravel()[i]), np.sin(q.ravel()[i])
        turn = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        poses[link.name] = poses[link.parent] @ np.linalg.inv(at_zero[link.parent]) @ link.pose @ turn
        sphere = HAND.spheres[i]
        assert np.allclose((poses[link.name] @ [*sphere.position, 1.0])[:3], found.reshape(-1, 3)[i], atol=1e-15)


def test_the_caliper_opposes_two_fingers_and_clears_the_third():
    tips = HAND.contacts(HAND.unloaded(HAND.closings("caliper", 0.5)))[:, -1]
    assert np.allclose(tips[0] * [-1, 1, 1], tips[1], atol=1e-15)
    assert tips[2, 2] < tips[0, 2] - 0.02


def test_modes_go_straight_from_open_to_closed():
    for mode, pattern in HAND.modes.items():
        assert HAND.closings(mode, 0.0).tolist() == list(pattern.open)
        assert HAND.closings(mode, 1.0) == pytest.approx(np.array(pattern.closed))
        for joint, u in zip(HAND.joints, [*pattern.open, *pattern.closed] * 2, strict=False):
            assert joint.lower <= u <= joint.upper


@pytest.mark.parametrize(("mode", "closing", "reason"), [("calliper", 0.5, "caliper"), ("grasp", 1.2, "0 .* to 1")])
def test_what_is_no_mode_is_refused(mode, closing, reason):
    with pytest.raises(MotionError, match=reason):
        HAND.closings(mode, closing)


def test_the_tip_is_reached_even_where_the_orientation_is_only_near():
    chain = arms.chain("PSM1", "MUSHA_HAND")
    pose = chain.forward(np.array([0.1, -0.2, 0.12, 0.3]))
    pose[:3, 3] += [0.01, 0.02, 0.0]
    q = inverse(chain, pose, np.zeros(4))
    assert np.allclose(chain.forward(q)[:3, 3], pose[:3, 3], atol=1e-12)
