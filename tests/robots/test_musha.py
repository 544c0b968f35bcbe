import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.dvrk import arms
from robots.dvrk.end_effectors.musha import HAND, TROCAR_RADIUS
from robots.dvrk.inverse import inverse
from schemas.errors import MotionError

PULLEYS = np.array([phalanx.pulley for phalanx in HAND.phalanges])
LOWER, UPPER = (np.array([getattr(joint, end) for joint in HAND.joints]) for end in ("lower", "upper"))
commands = st.tuples(*(st.floats(joint.lower, joint.upper) for joint in HAND.joints)).map(np.array)


def test_the_folded_hand_passes_the_trocar_with_its_spheres():
    centres = HAND.contacts(HAND.unloaded_positions(HAND.command("folded", 0.0)))
    assert (np.hypot(centres[..., 0], centres[..., 1]) + HAND.radius < TROCAR_RADIUS).all()


def test_fingers_of_the_folded_hand_lie_side_by_side():
    tips = HAND.contacts(np.zeros((3, 3)))[:, -1]
    apart = [np.linalg.norm(tips[i] - tips[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
    assert min(apart) > 2.0 * HAND.radius


@given(commands)
def test_an_unloaded_finger_winds_up_what_it_is_told_or_its_tendon_is_slack(command):
    q = HAND.unloaded_positions(command)
    for finger, (closing, spread) in enumerate(command.reshape(2, 3).T.tolist()):
        tension = HAND.tension(closing, spread)
        assert tension >= 0.0
        assert all(p.lower <= q[finger, j] <= p.upper for j, p in enumerate(HAND.phalanges))
        wound = q[finger] @ PULLEYS / PULLEYS[0]
        assert wound == pytest.approx(closing, abs=1e-9) or (tension == 0.0 and wound > closing)


@given(commands)
def test_an_unloaded_finger_is_in_balance(command):
    """Where a joint is at no stop, the torque of its tendon is that of its spring."""
    q = HAND.unloaded_positions(command)
    for finger, (closing, spread) in enumerate(command.reshape(2, 3).T.tolist()):
        tension = HAND.tension(closing, spread)
        for j, p in enumerate(HAND.phalanges):
            rest = p.rest + (spread if j == 0 else 0.0)
            if p.lower + 1e-9 < q[finger, j] < p.upper - 1e-9:
                assert p.pulley * tension == pytest.approx(p.stiffness * (q[finger, j] - rest), abs=1e-12)


def test_the_motors_can_bend_a_spread_finger_all_the_way():
    first = HAND.phalanges[0]
    bent = np.array([first.lower, *(phalanx.upper for phalanx in HAND.phalanges[1:])]) @ PULLEYS / PULLEYS[0]
    assert HAND.tension(bent, first.lower) * first.pulley < HAND.effort


def test_contacts_are_where_the_links_are():
    """The closed form against the product of the links' transforms."""
    q = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 3))
    found = HAND.contacts(q)
    poses = {"roll": np.eye(4)}
    at_zero = {"roll": np.eye(4), **{link.name: link.pose for link in HAND.bones}}
    for i, link in enumerate(HAND.bones):
        c, s = np.cos(q.ravel()[i]), np.sin(q.ravel()[i])
        turn = np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        poses[link.name] = poses[link.parent] @ np.linalg.inv(at_zero[link.parent]) @ link.pose @ turn
        sphere = HAND.spheres(np.eye(4))[i]
        assert np.allclose(
            (poses[link.name] @ [*sphere.position, 1.0])[:3], found.reshape(-1, 3)[i], atol=1e-15
        )


@pytest.mark.parametrize("closing", [0.0, 0.3, 0.7, 0.95])
def test_the_caliper_closes_two_parallel_fingers_and_clears_the_third(closing):
    q = HAND.unloaded_positions(HAND.command("caliper", closing))
    assert np.allclose(q[:2].sum(axis=1), 0.0, atol=np.radians(0.05))
    tips = HAND.contacts(q)[:, -1]
    assert np.allclose(tips[0] * [-1, 1, 1], tips[1], atol=1e-15)
    assert tips[2, 2] < tips[0, 2] - 0.02


def test_the_retractor_fans_straight_fingers_out():
    q = HAND.unloaded_positions(HAND.command("retractor", 0.0))
    assert np.allclose(q[:, 0], np.radians(-85.0))
    assert np.allclose(q[:, 1:], 0.0)


def test_modes_go_straight_from_open_to_closed():
    for mode, pattern in HAND.modes.items():
        assert HAND.command(mode, 0.0).tolist() == list(pattern.open)
        assert HAND.command(mode, 1.0) == pytest.approx(np.array(pattern.closed))
        for joint, u in zip(HAND.joints, [*pattern.open, *pattern.closed] * 2, strict=False):
            assert joint.lower <= u <= joint.upper


@pytest.mark.parametrize(
    ("mode", "closing", "reason"), [("calliper", 0.5, "caliper"), ("grasp", 1.2, "0 .* to 1")]
)
def test_what_is_no_mode_is_refused(mode, closing, reason):
    with pytest.raises(MotionError, match=reason):
        HAND.command(mode, closing)


def test_the_tip_is_reached_even_where_the_orientation_is_only_near():
    chain = arms.chain("PSM1", "MUSHA_HAND")
    pose = chain.forward(np.array([0.1, -0.2, 0.12, 0.3]))
    pose[:3, 3] += [0.01, 0.02, 0.0]
    q = inverse(chain, pose, np.zeros(4))
    assert np.allclose(chain.forward(q)[:3, 3], pose[:3, 3], atol=1e-12)
