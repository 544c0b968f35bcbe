"""Classes of failure, and the instant that decided."""

from types import SimpleNamespace

import pytest

from learning.judge.failures import FAILURES, classify
from learning.judge.happened import Happened

END = 10.0


def course(events, *, lost=False, succeeded=False):
    happened = Happened(SimpleNamespace(time_s=END))
    for time, kind in events:
        happened.first.setdefault(kind, time)
        happened.last[kind] = time
        happened.counts[kind] += 1
    happened.lost, happened.succeeded = lost, succeeded
    return happened


@pytest.mark.parametrize(
    ("events", "kind", "time"),
    [
        ([], "never grasped", END),
        ([(1.0, "grasped"), (2.0, "lifted")], "never handed over", END),
        ([(1.0, "grasped"), (2.0, "handed over")], "goal not reached", END),
        ([(1.0, "grasped"), (2.0, "dropped")], "dropped", 2.0),
        (
            [(1.0, "grasped"), (2.0, "dropped"), (3.0, "grasped"), (4.0, "handed over")],
            "goal not reached",
            END,
        ),
        ([(1.0, "grasped"), (2.5, "torn"), (3.0, "torn")], "torn", 2.5),
    ],
)
def test_two_hands(events, kind, time):
    assert classify(course(events), error=False, grasps=True, hands=2) == (kind, time)
    assert kind in FAILURES


def test_other_ends():
    dropped = [(1.0, "grasped"), (2.0, "dropped")]
    assert classify(course(dropped, lost=True), error=False, grasps=True, hands=1) == ("object lost", 2.0)
    assert classify(course(dropped), error=True, grasps=True, hands=1) == ("policy failed", END)
    assert classify(course([]), error=False, grasps=False, hands=1) == ("goal not reached", END)
    assert classify(course(dropped, succeeded=True), error=False, grasps=True, hands=1) is None
