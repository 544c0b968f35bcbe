import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.observation.latency import Histogram, Latencies, by_way


@given(st.lists(st.integers(0, 2**45), min_size=1, max_size=200), st.sampled_from([0.01, 0.5, 0.99, 1.0]))
def test_percentiles_are_right_within_a_bin(times, share):
    histogram = Histogram()
    for time in times:
        histogram.add(time)
    exact = int(np.percentile(times, 100 * share, method="inverted_cdf"))
    assert histogram.percentile(share) == pytest.approx(exact, rel=1 / 32, abs=0.5)
    assert (histogram.count, histogram.largest_ns) == (len(times), max(times))


@given(st.integers(0, 2**63))
def test_one_time_is_told_as_it_was(time):
    histogram = Histogram()
    histogram.add(time)
    assert histogram.percentile(0.5) == pytest.approx(time, rel=1e-15)


def test_memory_does_not_grow():
    histogram = Histogram()
    times = np.random.default_rng(1).integers(0, 2**62, 20_000).tolist()
    tracemalloc.start()
    try:
        for time in times:
            histogram.add(time)
        grown, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert grown < 4096
    assert histogram.count == 20_000


def test_nothing_has_no_percentile_and_two_clocks_may_disagree():
    histogram = Histogram()
    with pytest.raises(ValueError, match="a histogram without times has no percentile"):
        histogram.percentile(0.5)
    histogram.add(-5)
    assert histogram.percentile(0.99) == 0


def test_streams_are_told_by_way_and_name():
    latencies = Latencies()
    for stream, time in (("b.out", 3_000_000), ("a.out", 1_000_000), ("a.out", 1_000_000)):
        latencies.add("device to grant", stream, time)
    rows = by_way(latencies.messages())
    assert list(rows["device to grant"]) == ["a.out", "b.out"]
    assert rows["device to grant"]["a.out"] == {
        "count": 2,
        "p50_s": pytest.approx(1e-3, rel=0.02),
        "p99_s": pytest.approx(1e-3, rel=0.02),
        "largest_s": 1e-3,
    }
