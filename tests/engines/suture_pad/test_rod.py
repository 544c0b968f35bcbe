"""The shape of a thread: as long as it is, straight when taut, on the skin when slack, in its passages."""

import numpy as np
import pytest

from engines.suture_pad.passages import Passages
from engines.suture_pad.rod import Rod
from engines.suture_pad.tissue import TissueParams
from robots.training.threads import ThreadParams

THREAD = ThreadParams()
FORWARD = np.array([1.0, 0.0, 0.0])
DT = 0.04
ANGLES = np.linspace(0.0, np.pi, 24)
CHANNEL = 7e-3 * np.stack([np.cos(ANGLES), 0 * ANGLES, -np.sin(ANGLES)], axis=1)


def edges(rod):
    return np.linalg.norm(np.diff(rod.state.nodes, axis=0), axis=1)


def test_it_lies_straight_behind_the_base_at_first():
    rod = Rod(THREAD, -0.01)
    assert (rod.state.nodes[:, 2] == -0.01).all()  # hidden until it is known where the needle is
    rod.settle(np.array([0.02, 0.0, 0.4e-3]), FORWARD, [], DT)
    assert edges(rod) == pytest.approx(np.full(THREAD.segments, THREAD.segment), abs=3e-6)
    assert rod.state.nodes[-1] == pytest.approx([-0.08, 0.0, 0.0], abs=0.5e-3)


def test_it_follows_a_needle_that_is_lifted_and_sinks_on_to_the_skin():
    rod = Rod(THREAD, -0.01)
    for way in np.linspace(0.0, 1.0, 50):
        base = np.array([0.02 - 0.05 * way, 0.03 * np.sin(6 * way), 0.4e-3 + 0.05 * way])
        rod.settle(base, FORWARD, [], DT)
        assert edges(rod) == pytest.approx(np.full(THREAD.segments, THREAD.segment), rel=0.01)
    for _ in range(100):
        rod.settle(base, FORWARD, [], DT)
    assert (rod.state.nodes[-6:, 2] < 1e-3).all()
    assert rod.state.nodes[:, 2].min() > -1e-5
    before = rod.state.nodes.copy()
    rod.settle(base, FORWARD, [], DT)
    assert np.abs(rod.state.nodes - before).max() < 5e-5


@pytest.mark.parametrize("friction", [10.0, 50.0])
def test_a_taut_thread_is_straight_and_right_in_length_however_hard_it_is_pulled(friction):
    """With 50 N/m the channel holds it with 1.1 N."""
    passages, rod = Passages(THREAD, TissueParams(thread_friction=friction)), Rod(THREAD, -0.01)
    passages.open(CHANNEL, 25e-3)
    fastest, before = 0.0, None
    for way in np.linspace(4e-3, 50e-3, 60):
        base = CHANNEL[-1] + way * np.array([-0.6, 0.0, 0.8])
        passages.advance(base, FORWARD, None)
        rod.settle(base, FORWARD, list(passages), DT)
        nodes = rod.state.nodes
        if way > 8e-3:  # before, it is laid out and put into a channel that it has not come by
            fastest = max(fastest, float(np.linalg.norm(nodes - before, axis=1).max()) / DT)
        before = nodes.copy()
        (passage,) = passages
        outside = rod._ways < passage.through - passage.length
        line = (nodes[outside] - CHANNEL[-1]) @ np.array([0.8, 0.0, 0.6])
        assert np.abs(line).max() < 1e-6
        assert edges(rod)[: outside.sum() - 1] == pytest.approx(THREAD.segment, rel=1e-3)
    assert passages.pull == pytest.approx(friction * 22e-3, rel=0.01)
    assert fastest < 0.1  # the base goes 20 mm/s


def test_what_is_in_a_passage_lies_on_it_and_edges_are_whole():
    passages, rod = Passages(THREAD, TissueParams()), Rod(THREAD, -0.01)
    passages.open(CHANNEL, 52e-3)
    base = CHANNEL[-1] + [-0.02, 0.0, 0.01]
    for _ in range(20):
        rod.settle(base, FORWARD, list(passages), DT)
    (passage,) = passages
    ways = passage.through - rod._ways
    inside = (ways > 0.0) & (ways < passage.length)
    assert inside.sum() >= 8
    away = np.linalg.norm(rod.state.nodes[inside][:, None] - CHANNEL, axis=2).min(axis=1)
    assert away.max() < 0.6e-3  # the channel's points are 0.9 mm apart
    assert np.linalg.norm(rod.state.nodes[inside][:, [0, 2]], axis=1) == pytest.approx(7e-3, abs=0.03e-3)
    assert edges(rod).max() < 1.001 * THREAD.segment


def test_a_saved_rod_goes_on_with_the_same_bits():
    rod, other = Rod(THREAD, -0.01), Rod(THREAD, -0.01)
    base = np.array([0.02, 0.0, 0.03])
    rod.settle(base, FORWARD, [], DT)
    other.state.values[:] = rod.state.values
    for one in (rod, other):
        one.settle(base + 1e-3, FORWARD, [], DT)
    assert other.state.values.tobytes() == rod.state.values.tobytes()
