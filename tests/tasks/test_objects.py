"""Events of objects that are held, let go, put down and dropped, and of instruments that touch."""

import numpy as np
import pytest

from tasks.instant import Instant
from tasks.objects import ObjectWatch
from tasks.params import TaskParams

PERIOD_S = 0.01
PARAMS = TaskParams.model_validate({"arms": {"PSM1": {}, "PSM2": {}}})


class Table:
    """One object over a table with a place at x > 0.1 m; steps of 10 ms."""

    def __init__(self, workspace=None):
        self.things = ObjectWatch(1, PARAMS, workspace, lambda _, pose: 3 if pose[0] > 0.1 else -1)
        self.now = Instant(2, 1, period_s=PERIOD_S)
        self.events = []
        self.things.start(self.now)

    def go(self, seconds, *, to=None, holder=-1, seen=True, impulse=0.0):
        """Move the object in a straight line."""
        steps = round(seconds / PERIOD_S)
        path = np.linspace(self.now.poses[0, :3], self.now.poses[0, :3] if to is None else to, steps + 1)
        for position in path[1:]:
            self.now.poses[0, :3] = position
            self.now.holders, self.now.impulse = [holder], self.now.impulse + impulse
            self.now.things_seen = np.array([seen])
            self.events += self.things.observe(self.now)
        return self

    @property
    def kinds(self):
        return [event.kind for event in self.events]


def test_it_is_grasped_lifted_and_placed():
    table = Table().go(0.1).go(0.5, to=(0, 0, 0.03), holder=0).go(0.5, to=(0.2, 0, 0.03), holder=0)
    table.go(0.5, to=(0.2, 0, 0.001), holder=0).go(0.5)
    assert table.kinds == ["grasped", "lifted", "placed"]
    assert [event.arm for event in table.events] == [0, 0, 0]
    assert table.events[1].value == pytest.approx(PARAMS.lift, abs=1e-3)
    assert table.events[2].place == 3


def test_a_hand_over_is_no_second_grasp():
    table = Table().go(0.2, to=(0, 0, 0.03), holder=0).go(0.2, holder=1)
    assert table.kinds == ["grasped", "lifted", "handed over"]
    assert table.events[-1].arm == 1


def test_what_falls_is_dropped_and_what_is_put_down_is_not():
    dropped = Table().go(0.2, to=(0, 0, 0.03), holder=0).go(0.08, to=(0, 0, 0.0)).go(0.5)
    assert dropped.kinds == ["grasped", "lifted", "dropped"]
    assert dropped.events[-1].value == pytest.approx(0.03, abs=4e-3)
    put = Table().go(0.2, to=(0, 0, 0.03), holder=0).go(0.2, to=(0, 0, 0.001), holder=0).go(0.5)
    assert put.kinds == ["grasped", "lifted"]


def test_what_falls_into_its_place_is_placed():
    table = Table().go(0.2, to=(0.2, 0, 0.03), holder=0).go(0.08, to=(0.2, 0, 0.0)).go(0.5)
    assert table.kinds == ["grasped", "lifted", "placed"]


def test_what_is_caught_in_the_air_was_not_dropped():
    table = Table().go(0.2, to=(0, 0, 0.1), holder=0).go(0.08, to=(0, 0, 0.06)).go(0.3, holder=1)
    assert table.kinds == ["grasped", "lifted", "grasped"]


def test_what_rolls_on_has_been_dropped_after_a_second():
    table = Table().go(0.2, to=(0, 0, 0.03), holder=0).go(0.08, to=(0, 0, 0)).go(1.5, to=(-0.5, 0, 0))
    assert table.kinds[-1] == "dropped"


def test_it_leaves_the_workspace_once():
    box = np.array([[-0.1, -0.1, -0.01], [0.1, 0.1, 0.1]])
    table = Table(box).go(0.5, to=(-0.3, 0, 0)).go(0.5).go(0.5, to=(0, 0, 0)).go(0.5, to=(0.3, 0, 0))
    assert table.kinds == ["out of workspace", "out of workspace"]


def test_it_leaves_the_view_once():
    table = Table().go(0.1).go(0.2, seen=False).go(0.2).go(0.2, seen=False)
    assert table.kinds == ["out of view", "out of view"]


def test_instruments_that_touch_again_at_once_have_not_parted():
    table = Table().go(0.1).go(0.05, impulse=1e-3).go(0.05).go(0.05, impulse=1e-3).go(0.2)
    assert table.kinds == ["collision"]
    assert table.go(0.05, impulse=1e-3).kinds == ["collision", "collision"]
    assert table.now.impulse == pytest.approx(0.015)
