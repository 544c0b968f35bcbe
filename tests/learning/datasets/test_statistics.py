import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from learning.datasets.statistics import PictureCounts, vector_statistics


@given(arrays(np.uint8, (3, 4, 8, 3)))
def test_counts_of_levels_give_the_statistics_of_the_pixels(pictures):
    counts = PictureCounts()
    for picture in pictures:
        counts.add(picture)
    found = counts.statistics()
    pixels = pictures[:, ::4, ::4].reshape(-1, 3) / 255.0
    expected = {"min": pixels.min(0), "max": pixels.max(0), "mean": pixels.mean(0), "std": pixels.std(0)}
    expected["q50"] = np.quantile(pixels, 0.5, axis=0, method="inverted_cdf")
    for name, value in expected.items():
        assert np.array(found[name]).shape == (3, 1, 1)
        np.testing.assert_allclose(np.ravel(found[name]), value, atol=1e-7)
    assert found["count"] == [3]


@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=20))
def test_vectors(numbers):
    found = vector_statistics(np.array([numbers, numbers]).T)
    assert found["mean"] == pytest.approx([np.mean(numbers)] * 2, abs=1e-9)
    assert found["min"][0] <= found["q01"][0] <= found["q50"][0] <= found["q99"][0] <= found["max"][0]
    assert found["count"] == [len(numbers)]
