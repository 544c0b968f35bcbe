import numpy as np
import pytest

from robots.dvrk import held_needle, psm
from robots.dvrk.held_needle import Needle
from robots.dvrk.instruments import instrument
from schemas.errors import MotionError

TOOL, NEEDLE = instrument("ROLLING_NEEDLE_DRIVER"), Needle()
HELD = NEEDLE.arc * 0.7
CHAIN = held_needle.chain(TOOL, NEEDLE, HELD)


def configurations(count):
    rng = np.random.default_rng(0)
    q = rng.uniform(CHAIN.lower, CHAIN.upper, (count, 7))
    q[:, -1] = held_needle.rolls(CHAIN)[rng.integers(0, len(held_needle.rolls(CHAIN)), count)]
    return q


def wire(pose, behind_the_tip):
    """A point of the wire."""
    angle = NEEDLE.arc / 2 - behind_the_tip
    return pose[:3, :3] @ (NEEDLE.radius * np.array([np.cos(angle), np.sin(angle), 0.0])) + pose[:3, 3]


def test_the_jaw_is_where_the_standard_needle_driver_has_it():
    driver = psm.chain(instrument("LARGE_NEEDLE_DRIVER_400006"))
    q = configurations(1)[0]
    frames = CHAIN.frames(q)
    assert np.allclose(frames[5, :3, 3], driver.frames(q[:6])[5, :3, 3], atol=1e-15)
    assert np.allclose(
        frames[6, :3, 3], (driver.forward(q[:6]) @ [0.0, 0.0, TOOL.jaw.distance, 1.0])[:3], atol=1e-15
    )


def test_rolling_turns_the_needle_about_its_tangent_in_the_jaw_and_leaves_the_held_point():
    q = np.array([*psm.HOME, 0.0])
    tip = psm.chain(TOOL).forward(q[:6])
    straight = CHAIN.forward(q)
    grip = tip @ [0.0, 0.0, TOOL.jaw.distance, 1.0]
    for roll in np.radians([-90.0, -30.0, 45.0, 90.0]):
        rolled = CHAIN.forward(np.array([*psm.HOME, roll]))
        assert np.allclose(wire(rolled, HELD), grip[:3], atol=1e-15)
        turn = rolled[:3, :3] @ straight[:3, :3].T
        assert np.allclose(turn @ tip[:3, 0], tip[:3, 0])  # the wrist yaw axis, and the tangent
        assert np.cos(roll) == pytest.approx((np.trace(turn) - 1) / 2)


def test_ahead_forehand_and_backhand():
    tip = psm.chain(TOOL).forward(np.array(psm.HOME))
    ahead, grip = tip[:3, 2], (tip @ [0.0, 0.0, TOOL.jaw.distance, 1.0])[:3]
    poses = {roll: CHAIN.forward(np.array([*psm.HOME, np.radians(roll)])) for roll in (-90.0, 0.0, 90.0)}
    assert (poses[0.0][:3, 3] - grip) @ ahead == pytest.approx(NEEDLE.radius)
    assert poses[-90.0][:3, 2] @ ahead == pytest.approx(1.0)
    assert poses[90.0][:3, 2] @ ahead == pytest.approx(-1.0)
    assert (wire(poses[0.0], HELD - 0.01) - grip) @ tip[:3, 0] > 0.0  # the tip's side


def test_there_and_back():
    q = configurations(500)
    pose = CHAIN.forward(q)
    found = held_needle.inverse(TOOL, CHAIN, pose)
    assert ((CHAIN.lower <= found) & (found <= CHAIN.upper)).all()
    assert np.allclose(CHAIN.forward(found), pose, atol=1e-9)


def test_of_all_rolls_that_is_taken_which_keeps_the_joints_from_their_limits():
    q = configurations(200)
    found = held_needle.inverse(TOOL, CHAIN, CHAIN.forward(q))
    middle, half = (CHAIN.upper + CHAIN.lower) / 2, (CHAIN.upper - CHAIN.lower) / 2
    cost, own = (((values - middle) / half) ** 2 for values in (found, q))
    assert (cost.sum(axis=1) <= own.sum(axis=1) + 1e-9).all()
    assert cost.sum() < 0.9 * own.sum()


def test_what_cannot_be():
    with pytest.raises(MotionError, match="none of 13 rolls"):
        held_needle.inverse(
            TOOL, CHAIN, CHAIN.forward(configurations(1)[0]) + np.array([[0, 0, 0, 1.0]] * 3 + [[0] * 4])
        )
    with pytest.raises(MotionError, match="ROLLING_NEEDLE_DRIVER"):
        held_needle.chain(instrument("400006"), NEEDLE, HELD)
    with pytest.raises(MotionError, match="behind its tip"):
        held_needle.chain(TOOL, NEEDLE, 4.0)
