"""A needle in tissue: forces that are known, energy that cannot be made, a channel that is not left."""

from itertools import pairwise
from math import acos, cos, degrees, pi, radians, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.suture_pad.channel import Channel, Phase
from engines.suture_pad.three_points import ThreePoints
from engines.suture_pad.tissue import TissueParams
from robots import rotation
from robots.training.needles import NEEDLES

NEEDLE, TISSUE = NEEDLES["sh-plus"], TissueParams()
BITE = 16e-3
HEIGHT = (NEEDLE.radius**2 - (BITE / 2) ** 2) ** 0.5
ENTRY = pi / 2 - acos(HEIGHT / NEEDLE.radius)
EXIT = pi - ENTRY


def pose(angle, aside=(0.0, 0.0, 0.0)):
    """The needle with its tip at an angle of the circle: from +x, down, to -x; moved aside (m)."""
    turn = angle - NEEDLE.arc / 2
    axes = np.array([[cos(turn), -sin(turn), 0.0], [0.0, 0.0, 1.0], [-sin(turn), -cos(turn), 0.0]])
    return axes, np.array([0.0, 0.0, HEIGHT]) + aside


def driven(until, start=ENTRY - 0.1, channel=None, step=0.004):
    """Turn a needle on along its circle, and return the channel and force, moment and state at each step."""
    channel = channel or Channel(NEEDLE, TISSUE)
    found = []
    for angle in np.arange(start, until, step):
        force, moment = channel.advance(*pose(angle), over_pad=True)
        found.append((angle, force, moment, channel.state.phase, channel.state.tip, channel.state.length))
    return channel, found


def test_the_tip_meets_two_peaks_and_between_them_cutting_and_growing_friction():
    channel, found = driven(EXIT + 0.5)
    phases = [row[3] for row in found]
    tips = np.array([row[4] for row in found])
    entered, exited = phases.index(Phase.IN), phases.index(Phase.THROUGH)
    assert tips[:entered].max() == pytest.approx(TISSUE.entry_puncture, abs=0.05)
    assert tips[entered + 5 : exited - 60] == pytest.approx(TISSUE.cutting)
    assert tips[entered + 1 : exited].max() == pytest.approx(TISSUE.exit_puncture, abs=0.05)
    assert tips[exited:] == pytest.approx(0.0)
    middle = (entered + exited) // 2
    angle, force, moment, _, _, length = found[middle]
    # along its circle a needle has no moment about the axis but of what is along the arc
    centre = pose(angle)[1]
    along = (moment - np.cross(centre, force))[1] / NEEDLE.radius
    assert along == pytest.approx(-(TISSUE.cutting + TISSUE.friction * length), rel=0.04)
    assert np.linalg.norm(channel.state.came_out - [-BITE / 2, 0.0, 0.0]) < 0.1e-3
    assert np.linalg.norm(channel.state.points[0] - [BITE / 2, 0.0, 0.0]) < 0.15e-3


def test_speed_changes_nothing():
    _, slow = driven(EXIT, step=0.002)
    _, fast = driven(EXIT, step=0.008)
    at = {round(row[0], 6): row[1] for row in slow}
    for angle, force, *_ in fast[60:-80]:
        assert force == pytest.approx(at[round(angle, 6)], abs=0.04)


def test_a_needle_that_is_pulled_all_through_leaves_by_the_far_end():
    channel, _ = driven(EXIT + NEEDLE.arc + 0.1)
    assert channel.state.phase is Phase.OUT
    assert channel.state.pulled_out
    force, moment = channel.advance(*pose(EXIT + NEEDLE.arc + 0.2), over_pad=True)
    assert not force.any()
    assert not moment.any()


def test_a_needle_that_is_turned_back_leaves_as_it_came_and_cuts_nothing_on_its_way():
    channel, _ = driven(ENTRY + 0.8)
    cut = channel.state.cut
    for angle in np.arange(ENTRY + 0.8, ENTRY - 0.1, -0.004):
        channel.advance(*pose(angle), over_pad=True)
        if angle > ENTRY + 0.05:
            assert channel.state.tip <= TISSUE.cutting + 1e-9
            assert channel.state.cut == cut
    assert channel.state.phase is Phase.OUT
    assert not channel.state.pulled_out


@pytest.mark.parametrize("aside", [(1e-3, 0, 0), (0, 1e-3, 0), (0, 0, 1e-3), (-1e-3, 0, 0), (0, 0, -1e-3)])
def test_it_can_only_follow_its_channel(aside):
    angle = EXIT + 0.3
    channel, found = driven(angle)
    forward = np.array(found[-1][1])
    force, _ = channel.advance(*pose(angle, aside), over_pad=True)
    pulled = (force - forward) @ aside / np.linalg.norm(aside)
    embedded = channel.state.covered
    # as stiff as the length of the arc in tissue, less what of it can slip along the arc
    assert -1.05 * TISSUE.compression * embedded * 1e-3 < pulled
    assert pulled < -0.15 * TISSUE.compression * embedded * 1e-3
    assert channel.state.swept > 0.25 * embedded * 1e-3
    back, _ = channel.advance(*pose(angle), over_pad=True)
    assert np.linalg.norm(back - forward) < 2.1 * TISSUE.friction * embedded


@given(
    st.lists(st.tuples(*[st.floats(-1e-3, 1e-3)] * 3, *[st.floats(-0.08, 0.08)] * 3), min_size=2, max_size=5),
    st.floats(0.3, 1.2),
)
def test_whatever_way_it_is_moved_and_brought_back_the_tissue_gives_no_energy(ways, depth):
    channel, found = driven(ENTRY + depth, step=0.01)
    axes, origin = pose(found[-1][0])
    corners = [np.zeros(6), *(np.array(way) for way in ways), np.zeros(6)]
    path = np.concatenate(
        [start + (end - start) * np.linspace(0, 1, 60)[1:, None] for start, end in pairwise(corners)]
    )
    work, last, here = 0.0, None, None
    for step in path:
        turn = rotation.matrix(rotation.exp(step[3:]))
        now = turn @ axes, origin + step[:3]
        force, moment = channel.advance(*now, over_pad=True)
        if last is not None:
            twist = rotation.log(rotation.from_matrix(now[0] @ here[0].T))
            shift = now[1] - here[1]
            mean = (np.concatenate([force, moment - np.cross(now[1], force)]) + last) / 2
            work -= float(mean @ np.concatenate([shift, twist]))
        last, here = np.concatenate([force, moment - np.cross(now[1], force)]), now
    # what was stretched before it moved may come back: tip and friction of the way in
    stored = 0.5 * TISSUE.give * (TISSUE.cutting + TISSUE.friction * 20e-3)
    assert work > -stored - 0.02 * abs(work) - 2e-6


def test_wherever_and_however_the_pad_lies_the_needle_feels_the_same():
    _, found = driven(EXIT)
    again = driven(EXIT)[1]
    assert all((a[1] == b[1]).all() for a, b in zip(found, again, strict=True))


def test_a_needle_on_the_skin_is_carried_and_beside_the_pad_nothing_is():
    channel = Channel(NEEDLE, TISSUE)
    flat = np.diag([1.0, -1.0, -1.0])
    force, _ = channel.advance(flat, np.array([0.0, 0.0, NEEDLE.wire_radius - 1e-5]), over_pad=True)
    assert force[2] == pytest.approx(TISSUE.surface * NEEDLE.length * 1e-5, rel=0.05)
    axes, origin = pose(ENTRY + 0.03)
    force, _ = Channel(NEEDLE, TISSUE).advance(axes, origin, over_pad=False)
    assert not force.any()


@given(st.integers(0, 2**32 - 1))
def test_three_points_carry_every_wrench_and_frame(seed):
    drawn = np.random.default_rng(seed)
    axes = rotation.matrix(rotation.exp(drawn.uniform(-2, 2, 3)))
    origin = drawn.uniform(-0.1, 0.1, 3)
    for needle in NEEDLES.values():
        points = needle.bond_points @ axes.T + origin
        turned, placed = ThreePoints(needle.bond_points).frame(points)
        assert turned == pytest.approx(axes, abs=1e-9)
        assert placed == pytest.approx(origin, abs=1e-12)
        force, moment = drawn.uniform(-1, 1, 3), drawn.uniform(-0.02, 0.02, 3)
        forces = ThreePoints.forces(points, force, moment)
        assert forces.sum(axis=0) == pytest.approx(force, abs=1e-12)
        assert np.cross(points, forces).sum(axis=0) == pytest.approx(moment, abs=1e-12)


def test_the_way_in_is_as_steep_as_the_circle():
    assert degrees(ENTRY) == pytest.approx(45.6, abs=0.1)
    assert radians(45) < ENTRY
