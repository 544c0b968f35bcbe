"""Calls in worker processes."""

import os

import pytest

from learning.workers import run_calls

THREADS = "LP_NUM_THREADS"


def test_workers_share_the_cores_for_drawing(monkeypatch):
    monkeypatch.delenv(THREADS, raising=False)
    monkeypatch.setattr("os.cpu_count", lambda: 6)
    assert list(run_calls(os.getenv, [(THREADS,)], 6)) == [(0, "1")]
    assert list(run_calls(os.getenv, [(THREADS,)], 3)) == [(0, "2")]
    assert THREADS not in os.environ


@pytest.mark.parametrize("workers", ["threading", "loky"])
def test_results_have_the_numbers_of_their_calls(workers):
    calls = [(number,) for number in range(4)]
    assert sorted(run_calls(abs, calls, 2, workers=workers)) == [(i, i) for i in range(4)]
