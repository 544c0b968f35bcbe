"""A thread in the channels that it was drawn through: it stays there, rubs, leaves, and gives no energy."""

from itertools import pairwise

import numpy as np
import pytest

from engines.suture_pad.passages import APART, Passages
from engines.suture_pad.tissue import TissueParams
from robots.training.threads import ThreadParams

THREAD, TISSUE = ThreadParams(), TissueParams()
ANGLES = np.linspace(0.0, np.pi, 24)
CHANNEL = 7e-3 * np.stack([np.cos(ANGLES), 0 * ANGLES, -np.sin(ANGLES)], axis=1)
"""A half circle, 22 mm long, with its points about 1 mm apart."""


def line(through):
    """Nodes of a thread that runs through the channel, with so much of it (m) beyond the mouth."""
    way = through - THREAD.segment * np.arange(THREAD.segments + 1)
    length = 7e-3 * np.pi
    angle = np.clip(way, 0.0, length) / 7e-3
    nodes = 7e-3 * np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], axis=1)
    nodes[:, 2] += np.maximum(way - length, 0.0) + np.maximum(-way, 0.0)
    return nodes


def drawn(ways):
    passages = Passages(THREAD, TISSUE)
    passages.open(CHANNEL, ways[0])
    return passages, [passages.advance(line(way)) for way in ways]


def test_it_follows_the_thread_that_is_drawn_through_and_rubs_against_it():
    ways = np.arange(1e-3, 60e-3, 1e-4)
    passages, forces = drawn(ways)
    assert passages.state.through[0] == pytest.approx(ways[-1], abs=0.6e-3)
    lost = sum(float((forces[i] * (line(ways[i]) - line(ways[i - 1]))).sum()) for i in range(-200, 0))
    assert -lost / 200e-4 == pytest.approx(TISSUE.thread_friction * 22e-3, rel=0.15)


def test_it_is_forgotten_once_the_thread_has_left_it():
    passages, forces = drawn(np.arange(1e-3, 130e-3, 2e-4))
    assert not passages.state.counts.any()
    assert not forces[-1].any()


def test_a_thread_that_is_pulled_aside_is_pushed_back():
    passages, _ = drawn(np.array([40e-3]))
    aside = line(40e-3)
    aside[:, 1] += 0.1e-3
    force = passages.advance(aside).sum(axis=0)
    assert force[1] == pytest.approx(-TISSUE.compression * len(CHANNEL) * APART * 0.1e-3, rel=0.05)


def test_moved_about_and_back_it_never_gives_energy():
    rng = np.random.default_rng(3)
    passages, _ = drawn(np.array([40e-3]))
    start = line(40e-3)
    ends = [start, *(start + rng.normal(0.0, 0.3e-3, start.shape) for _ in range(6)), start]
    work, before = 0.0, start
    for a, b in pairwise(ends):
        for share in np.linspace(0.0, 1.0, 200)[1:]:
            now = a + share * (b - a)
            work += float((passages.advance((now + before) / 2.0) * (now - before)).sum())
            before = now
    assert work < 0.0


def test_a_saved_passage_goes_on_with_the_same_bits():
    passages, _ = drawn(np.arange(1e-3, 30e-3, 1e-3))
    other = Passages(THREAD, TISSUE)
    other.state.values[:] = passages.state.values
    other.refresh()
    assert other.advance(line(31e-3)).tobytes() == passages.advance(line(31e-3)).tobytes()
