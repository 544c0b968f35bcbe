"""The way of the needle and the grips, and what makes a stitch infeasible."""

from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.expert.hand import RobotHand
from controllers.stitching.feasibility import best_reach
from controllers.stitching.geometry import Grip, grip_pose, stitch_between
from controllers.stitching.plan import make_plan, make_stitch, stitch_through
from robots.dvrk.instruments import instrument
from robots.dvrk.psm import chain
from robots.training.needles import NEEDLES
from robots.training.phantoms import PHANTOMS
from schemas.errors import MotionError

UP = np.array([0.0, 0.0, 1.0])


@given(st.floats(4e-3, 16e-3), st.floats(-pi, pi), st.sampled_from(sorted(NEEDLES)))
def test_the_needle_turns_in_one_circle_through_both_holes(bite, heading, name):
    needle = NEEDLES[name]
    along = np.array([np.cos(heading), np.sin(heading), 0.0])
    stitch = stitch_between(-along * bite / 2, along * bite / 2, UP, needle)
    for angle, hole in ((stitch.entry, -along), (stitch.exit, along)):
        pose = stitch.pose(angle)
        tip = pose[:3, :3] @ needle.marks[2] + pose[:3, 3]
        assert tip == pytest.approx(hole * bite / 2, abs=1e-12)
        assert stitch.angle(pose) == pytest.approx(angle)
    centres = [stitch.pose(angle)[:3, 3] for angle in (0.3, 1.0, 4.0)]
    assert np.ptp(centres, axis=0) == pytest.approx(0.0, abs=1e-15)
    forward = np.cross(stitch.pose(1.0)[:3, 2], stitch.pose(pi / 2)[:3, :3] @ needle.marks[2])
    assert forward @ along > 0.0
    assert np.linalg.det(stitch.axes) == pytest.approx(1.0)
    base = stitch.pose(stitch.base_out_angle)[:3, :3] @ needle.marks[0] + stitch.centre
    assert base == pytest.approx(along * bite / 2, abs=1e-9)


@pytest.mark.parametrize("outside", [False, True])
def test_a_grip_holds_the_wire_across_between_the_fingers(outside):
    needle = NEEDLES["sh-plus"]
    tip = grip_pose(Grip(0.5, left_outside=outside), needle, 9e-3)
    held = tip[:3, 3] + 9e-3 * tip[:3, 2]
    assert np.linalg.norm(held) == pytest.approx(needle.radius)
    along = np.cross([0, 0, 1], held / needle.radius)
    assert abs(tip[:3, 0] @ along) == pytest.approx(1.0)  # the wire is along the hinge
    assert np.linalg.det(tip[:3, :3]) == pytest.approx(1.0)


def test_what_cannot_be_stitched_is_refused_with_the_number_that_fails():
    small, phantom = NEEDLES["sh"], PHANTOMS["branch-top"]
    with pytest.raises(MotionError, match=r"the holes are 16\.6 mm apart, and the needle is 16\.6 mm across"):
        stitch_between(np.zeros(3), np.array([16.6e-3, 0, 0]), UP, small)
    moved = phantom.entries.copy()
    moved[0, 0, 3] = 0.081
    wide = type(phantom)(phantom.skin, phantom.base, moved, phantom.exits)
    with pytest.raises(MotionError, match=r"stitch 1: its entry is 1\.0 mm beside the pad"):
        make_stitch(wide, np.eye(4), 1, small)
    thin = type(phantom)((0.16, 0.12, 0.002), phantom.base, phantom.entries, phantom.exits)
    with pytest.raises(MotionError, match=r"stitch 1 would be 3\.3 mm deep, and the skin is 2\.0 mm thick"):
        make_stitch(thin, np.eye(4), 1, NEEDLES["sh-plus"])


def hands(shift=0.0):
    tool = instrument("LARGE_NEEDLE_DRIVER_400006")
    turn = np.radians(50.0)
    base = np.eye(4)
    base[1:3, 1:3] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    found = []
    for arm, x in (("PSM1", 0.07), ("PSM2", -0.07)):
        there = base.copy()
        there[:3, 3] = x, -0.115 + shift, 0.106
        found.append(RobotHand(arm, there, chain(tool), tool.jaw))
    return found


FLAT = np.diag([1.0, -1.0, -1.0, 1.0])
FLAT[:3, 3] = 0.045, -0.035, 0.4e-3
ANGLES = {"held": 2.7, "taken": 0.23, "emerge": 0.66, "lift": 0.025}


def stitches():
    phantom = PHANTOMS["branch-top"]
    return [make_stitch(phantom, np.eye(4), i + 1, NEEDLES["sh-plus"]) for i in range(4)]


def test_all_four_stitches_are_feasible_where_the_arms_of_the_scenario_stand():
    plan = make_plan(*hands(), stitches(), FLAT, **ANGLES)
    assert plan.margin > 0.25


def test_a_plan_says_which_joint_fails_and_which_angle():
    with pytest.raises(MotionError, match=r"of PSM1, .* would be .* allowed"):
        make_plan(*hands(shift=-0.2), stitches(), FLAT, **ANGLES)
    with pytest.raises(MotionError, match="held 100 degrees behind its tip, the jaw would be driven into"):
        make_plan(*hands(), stitches(), FLAT, **(ANGLES | {"held": np.radians(100)}))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_of_a_stitch_behind_the_wrist_it_says_the_wrists_angle(sign):
    """Not the insertion of a shaft that points away from the needle."""
    entry, leave = np.array([0.0, 8e-3 * sign, 0.0]), np.array([0.0, -8e-3 * sign, 0.0])
    stitch = stitch_through(PHANTOMS["branch-top"], np.eye(4), entry, leave, NEEDLES["sh-plus"], "the stitch")
    with pytest.raises(
        MotionError, match=r"of PSM[12], wrist_\w+ would be -?\d+\.\d degrees, allowed -76 to 76"
    ):
        make_plan(*hands(), [stitch], FLAT, **ANGLES)


def test_the_reach_is_that_of_the_joints():
    hand = hands()[0]
    q = np.array([[0.1, 0.2, 0.12, 0.3 * i, 0.2, -0.1] for i in range(4)])
    tips = hand.base @ np.array([hand.chain.forward(each) for each in q])
    found = best_reach(hand.chain, hand.base, tips)
    assert not found.failure_reason
    free = 2 * np.minimum(q - hand.chain.lower, hand.chain.upper - q) / (hand.chain.upper - hand.chain.lower)
    assert found.margin >= free.min() - 1e-9
