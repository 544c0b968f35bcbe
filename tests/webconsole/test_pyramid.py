"""Rows of a plot: any stretch of a series, in which no peak is lost."""

import numpy as np
import pytest

from webconsole.pyramid import Pyramid


@pytest.fixture(scope="module")
def series():
    times, values = np.arange(200_000) * 0.001, np.zeros((200_000, 2))
    values[43_210, 0], values[777, 1] = 5.0, -3.0
    return times, values


def test_every_peak_is_kept(series):
    rows = Pyramid(*series).rows(0.0, np.inf, 100)
    assert rows.shape == (200, 3)
    assert (rows[:, 1].max(), rows[:, 2].min()) == (5.0, -3.0)
    assert (np.diff(rows[:, 0]) >= 0).all()


def test_a_stretch_has_its_own_peaks_alone_and_a_short_one_every_value(series):
    pyramid = Pyramid(*series)
    rows = pyramid.rows(40.0, 50.0, 50)
    assert (rows[:, 1].max(), rows[:, 2].min()) == (5.0, 0.0)
    exact = pyramid.rows(43.2, 43.22, 50)
    assert np.allclose(exact[:, 0], np.arange(43_200, 43_221) * 0.001)
    assert exact[10, 1] == 5.0


def test_gaps_and_nothing():
    values = np.full((5000, 1), np.nan)
    values[100] = 1.0
    assert np.nanmax(Pyramid(np.arange(5000.0), values).rows(0, 5000, 10)[:, 1]) == 1.0
    assert Pyramid(np.zeros(0), np.zeros((0, 1))).rows(0, 1, 10).shape == (0, 2)
