from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from robots.dvrk import held_needle, stitch
from robots.dvrk.held_needle import Needle
from robots.dvrk.instruments import instrument
from robots.dvrk.stitch import Stitch
from robots.dvrk.stitch_study import study

NEEDLE, TOOL = Needle(), instrument("ROLLING_NEEDLE_DRIVER")
SOME = stitch.lattice()[::7]


@cache
def some():
    return study(SOME)


def ends(pose):
    """Tip and tail of the needle in the tissue's frame."""
    angles = np.array([1.0, -1.0]) * NEEDLE.arc / 2
    return (
        NEEDLE.radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(2)], axis=1) @ pose[:3, :3].T
        + pose[:3, 3]
    )


@pytest.mark.parametrize("tilt", [0.0, 0.5])
def test_the_needle_goes_in_at_one_point_and_out_at_the_other(tilt):
    one = Stitch(tilt, (0.01, -0.02), np.radians(60.0), np.radians(45.0), 0.8)
    poses = np.linalg.inv(stitch.tissue(tilt)) @ stitch.path(one, NEEDLE)
    way, middle = np.array([0.5, np.sqrt(3) / 2, 0.0]), np.array([0.01, -0.02, 0.0])
    half = NEEDLE.radius * np.sin(one.entry)
    assert np.allclose(ends(poses[0])[0], middle - half * way)  # touches
    angles = (np.pi / 2 - one.entry, np.pi / 2 + one.entry + stitch.EMERGE)
    heights = NEEDLE.radius * (np.cos(one.entry) - np.sin(np.linspace(*angles, len(poses))))
    assert np.allclose([ends(pose)[0][2] for pose in poses], heights)
    assert heights[-1] > 0.0  # has come out
    turned = poses[1][:3, :3] @ poses[0][:3, :3].T
    assert np.allclose(turned @ poses[0][:3, 2], poses[0][:3, 2])  # about its own z,
    assert np.cross(poses[0][:3, 0], poses[1][:3, 0]) @ poses[0][:3, 2] > 0.0  # forwards,
    assert np.allclose(poses[:, :3, 3], poses[0][:3, 3])  # in its own hole


def test_rolling_makes_stitches_feasible_that_are_not_without():
    made = some()
    assert not (made.without & ~made.rolling).any()
    assert not (made.regrasped & ~made.rolling).any()
    shares = made.shares()
    assert shares["feasible_share"] > 1.5 * shares["feasible_share_without"] > 0.0
    assert shares["feasible_share_without"] == made.constant.mean(axis=0).max()


def test_a_feasible_stitch_is_feasible_point_by_point():
    made = some()
    for i in np.flatnonzero(made.constant[:, 8])[:5]:
        one = SOME[i]
        seven = held_needle.chain(TOOL, NEEDLE, one.hold * NEEDLE.arc)
        poses = stitch.path(one, NEEDLE)
        q = held_needle.solutions(TOOL, seven, poses, made.rolls[8:9])[..., 0, :]  # (4, points, 6)
        inside = ((seven.lower[:6] <= q) & (q <= seven.upper[:6]))[..., [0, 1, 2, 4, 5]].all(axis=(1, 2))
        assert inside.any()
        for way in q[inside]:
            way[:, 3] = np.unwrap(way[:, 3])
            all_seven = np.column_stack([way, np.full(len(way), made.rolls[8])])
            assert np.allclose(seven.forward(all_seven), poses, atol=1e-9)


def test_mirrored_stitches_are_feasible_with_the_roll_mirrored():
    # The arm is its own mirror image but for wrist pitch and yaw being left and right of each other: forehand
    # becomes backhand.
    mirrored = tuple(
        replace(one, place=(one.place[0], -one.place[1]), direction=-one.direction) for one in SOME
    )
    there, back = some(), study(mirrored)
    assert np.array_equal(there.constant, back.constant[:, ::-1])
    assert np.array_equal(there.rolling, back.rolling)


def test_what_stops_the_roller_stops_the_stitches_that_need_it(monkeypatch):
    made = some()
    monkeypatch.setattr("robots.dvrk.stitch_study.DRIVE", 1e3)  # no joint can follow
    assert not study(SOME[:40]).rolling.any()
    assert made.rolling[:40].any()


def test_twice_the_same():
    one, other = some(), study(SOME)
    assert np.array_equal(one.constant, other.constant)
    assert np.array_equal(one.rolling, other.rolling)


def test_shares_by_a_property_add_up():
    made = some()
    by = made.shares_by("tilt")
    counts = [sum(one.tilt == tilt for one in SOME) for tilt in by]
    assert np.average([shares["feasible_share"] for shares in by.values()], weights=counts) == pytest.approx(
        made.shares()["feasible_share"]
    )
