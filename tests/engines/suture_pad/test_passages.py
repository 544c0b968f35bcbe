"""A thread in the channels that it was drawn through: what pulls it, what rubs, when it leaves, no energy."""

from itertools import pairwise

import numpy as np
import pytest

from engines.suture_pad.passages import MOST, Passages
from engines.suture_pad.tissue import TissueParams
from robots.training.threads import ThreadParams

THREAD, TISSUE = ThreadParams(), TissueParams()
ANGLES = np.linspace(0.0, np.pi, 24)
CHANNEL = 7e-3 * np.stack([np.cos(ANGLES), 0 * ANGLES, -np.sin(ANGLES)], axis=1)
"""Half a circle, 22 mm long, from x = 7 mm to x = -7 mm."""
LENGTH = float(np.linalg.norm(np.diff(CHANNEL, axis=0), axis=1).sum())
FULL = TISSUE.thread_friction * LENGTH
"""Friction of a channel that is full of thread, N."""
UP = np.array([0.0, 0.0, 1.0])


def passages(*ways, apart=15e-3):
    """Return passages in a row, `apart` along y, with so much thread (m) in them: the newest is the last."""
    made = Passages(THREAD, TISSUE)
    for row, way in enumerate(ways):
        made.open(CHANNEL + np.array([0.0, row * apart, 0.0]), way)
    return made


def above(way, row=0):
    """Return where the base is, so far (m) straight over the end of a channel."""
    return np.array([-7e-3, row * 15e-3, way])


def test_a_base_that_goes_away_draws_the_thread_after_it_against_friction():
    made = passages(30e-3)
    for way in np.arange(1e-3, 40e-3, 1e-4):
        force = made.advance(above(way), UP, None)
    assert made.state.through[0] == pytest.approx(LENGTH + 39.9e-3, abs=1e-6)
    assert force == pytest.approx([0.0, 0.0, -FULL], rel=1e-6)
    assert made.pull == pytest.approx(FULL)


def test_a_base_that_comes_back_has_slack_and_feels_nothing():
    made = passages(30e-3)
    made.advance(above(20e-3), UP, None)
    assert made.advance(above(15e-3), UP, None) == pytest.approx(np.zeros(3))
    assert made.state.through[0] == pytest.approx(LENGTH + 20e-3 - TISSUE.give)


def test_a_needle_in_the_channel_leads_its_thread_both_ways():
    made = passages(5e-3)
    assert made.advance(above(0.0), UP, 8e-3) == pytest.approx([0, 0, -TISSUE.thread_friction * 8e-3])
    assert made.advance(above(0.0), UP, 6e-3) == pytest.approx([0, 0, TISSUE.thread_friction * 6e-3])
    assert made.state.through[0] == pytest.approx(6e-3)


def test_a_taut_stitch_pulls_at_the_one_before():
    made = passages(80e-3, 5e-3)
    way = LENGTH + float(np.linalg.norm(CHANNEL[0] + [0.0, 15e-3, 0.0] - CHANNEL[-1]))
    assert made.advance(above(0.0), UP, 10e-3)[2] == pytest.approx(-TISSUE.thread_friction * 10e-3)
    assert made.state.through[0] == pytest.approx(80e-3)
    slack = 80e-3 - way - 10e-3
    force = made.advance(above(slack + 1e-3 + 10e-3 - LENGTH, 1), UP, None)
    assert made.state.through[0] == pytest.approx(81e-3)
    assert -force[2] == pytest.approx(2 * FULL)


def test_the_thread_leaves_the_oldest_passage_first_and_a_needle_that_goes_back_its_own():
    made = passages(60e-3, 5e-3)
    for way in np.arange(1e-3, 80e-3, 1e-3):
        made.advance(above(way, 1), UP, None)
    assert made.state.count == 1
    assert made.state.points[0, 0, 1] == 15e-3
    for way in np.arange(80e-3, 140e-3, 1e-3):
        made.advance(above(way, 1), UP, None)
    assert made.state.count == 0
    assert not made.state.values.any()
    made = passages(60e-3, 5e-3)
    made.advance(above(0.0), UP, -0.1e-3)
    assert made.state.count == 1
    assert made.state.through[0] == 60e-3


def test_no_more_are_opened_than_are_kept():
    assert not passages(*[10e-3] * (MOST - 1)).is_full
    assert passages(*[10e-3] * MOST).is_full


def test_moved_about_and_back_it_never_gives_energy():
    rng = np.random.default_rng(3)
    made = passages(70e-3, 40e-3)
    start = above(25e-3, 1)
    made.advance(start, UP, None)
    ends = [start, *(start + rng.normal(0.0, 3e-3, 3) for _ in range(12)), start]
    work, before, least = 0.0, start, 0.0
    for a, b in pairwise(ends):
        for share in np.linspace(0.0, 1.0, 200)[1:]:
            now = a + share * (b - a)
            work += float(made.advance((now + before) / 2.0, UP, None) @ (now - before))
            before = now
        least = min(least, work)
    assert work < 0.0
    assert least < -1e-4


def test_a_saved_passage_goes_on_with_the_same_bits():
    made = passages(60e-3, 5e-3)
    made.advance(above(3e-3), UP, 7e-3)
    other = Passages(THREAD, TISSUE)
    other.state.values[:] = made.state.values
    other.refresh()
    base = above(31e-3, 1)
    assert other.advance(base, UP, None).tobytes() == made.advance(base, UP, None).tobytes()
    assert other.state.values.tobytes() == made.state.values.tobytes()
