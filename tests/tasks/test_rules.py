"""The rules of others, held against trials whose scores are known."""

import numpy as np
import pytest

from schemas.trocar_msgs import ScoreValue
from tasks.events import Event
from tasks.goals import Goals
from tasks.instant import Instant
from tasks.rules import RULES, Setting
from tests.tasks.trials import grasp, hand, place

LEFT, RIGHT = frozenset({0, 1, 2}), frozenset({3, 4, 5})
POSTS = np.array([[x, 0.0, 0.01] for x in (-0.08, -0.06, -0.04, 0.04, 0.06, 0.08)])


def setting(**changes):
    goals = Goals(("a", "b", "c", "d", "e", "f"), POSTS, (LEFT,) * 3, (RIGHT,) * 3)
    known = {"things": ("r1", "r2", "r3"), "goals": goals, "is_board": True, "camera": True, "benchmarks": {}}
    return Setting(**(known | changes))


class Trial:
    """Rules that are given events at times (s)."""

    def __init__(self, name, **changes):
        self.rules = RULES[name](setting(**changes))
        self.now = Instant(2, 3, period_s=0.1)
        self.step = 0

    def until(self, seconds, *events):
        """Go on to `seconds`, with `events` at the end."""
        end = round(seconds / 0.1)
        while self.step < end:
            self.step += 1
            self.now.time_s = self.step * 0.1
            self.rules.update(self.now, events if self.step == end else ())
        return self

    def __getitem__(self, name):
        value = {one.name: one for one in self.rules.values({})}[name]
        return None if value.reason else value.value


def carried(thing, at):
    """A ring is grasped, handed over and placed."""
    return grasp(thing), hand(thing), place(thing, at)


def over():
    """All rings to the right."""
    return [event for i in range(3) for event in carried(i, 3 + i)]


def back():
    return [event for i in range(3) for event in carried(i, i)]


class TestIcra2026:
    def test_a_point_for_each_ring_that_is_handed_over_and_placed(self):
        assert Trial("icra2026").until(10, *carried(0, 3)).until(20, *carried(1, 5))["points"] == 2

    def test_none_without_a_hand_over(self):
        trial = Trial("icra2026").until(10, grasp(), place(0, 3))
        assert (trial["points"], trial["placed_any"]) == (0, 0)

    def test_none_for_the_way_back_before_all_are_right(self):
        assert Trial("icra2026").until(10, *carried(0, 3)).until(20, *carried(0, 1))["points"] == 1

    def test_then_back_until_180_s(self):
        trial = Trial("icra2026").until(50, *over()).until(100, *back()).until(150, *over())
        assert trial["points"] == 9
        assert trial.until(181, *back())["points"] == 9
        assert trial["time"] == 180.0

    def test_a_ring_out_of_the_workspace_ends_the_trial_in_one_reading_only(self):
        lost = Event("out of workspace", 2)
        ended, goes_on = (
            Trial(name).until(5, lost).until(10, *carried(0, 3)) for name in ("icra2026", "icra2026-live")
        )
        assert (ended["points"], goes_on["points"]) == (0, 1)
        assert (ended["time"], goes_on["time"]) == (5.0, 10.0)

    def test_a_tie_is_broken_by_motion_in_one_reading_and_by_the_last_success_in_the_other(self):
        assert Trial("icra2026").until(10, *carried(0, 3)).until(20)["tie"] == 0.0
        assert Trial("icra2026-live").until(10, *carried(0, 3)).until(20)["tie"] == 10.0
        assert Trial("icra2026-live").until(20)["tie"] is None

    def test_it_needs_a_board(self):
        assert Trial("icra2026", is_board=False).until(10, *carried(0, 3))["points"] is None


class TestSurrol:
    def at(self, trial, *positions):
        trial.now.poses[:, :3] = positions
        return trial

    def test_success_within_50_steps(self):
        trial = self.at(Trial("surrol"), *POSTS[:3]).until(5)
        assert trial["success"] == 0
        trial = self.at(trial, *POSTS[3:]).until(9.9)
        assert (trial["success"], trial["success_at_end"], trial["reached"]) == (1, 1, 3)
        assert trial["first_success"] == pytest.approx(5.2)

    def test_later_it_is_none(self):
        trial = self.at(Trial("surrol").until(10.1), *POSTS[3:]).until(11)
        assert (trial["success"], trial["success_at_end"]) == (0, 1)

    @pytest.mark.parametrize(
        ("across", "along", "reached"),
        [(4.9e-3, 0, 1), (5.1e-3, 0, 0), (0, 3.9e-3, 1), (0, 4.1e-3, 0), (4.9e-3, 3.9e-3, 1)],
    )
    def test_on_a_peg_5_mm_across_and_4_mm_along_it(self, across, along, reached):
        far = np.array([0.5, 0.5, 0.5])
        trial = self.at(Trial("surrol"), POSTS[3] + [0, across, along], far, far).until(1)
        assert trial["reached"] == reached

    def test_elsewhere_5_mm_of_distance(self):
        far = np.array([0.5, 0.5, 0.5])
        trial = self.at(Trial("surrol", is_board=False), POSTS[3] + [0, 3.9e-3, 3.9e-3], far, far).until(1)
        assert trial["reached"] == 0

    def test_it_needs_goals_with_positions(self):
        assert Trial("surrol", goals=Goals()).until(1)["success"] is None


class TestFls:
    def test_300_less_the_time_since_the_first_grasp(self):
        trial = Trial("fls").until(10, grasp(0)).until(30, *over())
        assert trial["score"] is None
        trial.until(50, *back())
        assert trial["score"] == pytest.approx(260.0)
        assert (trial["time"], trial["proficient"]) == (40.0, 1.0)

    def test_after_48_s_it_is_not_proficient(self):
        trial = Trial("fls").until(10, grasp(0)).until(30, *over()).until(58.2, *back())
        assert (trial["proficient"], trial["score"]) == (0, pytest.approx(251.8))

    def test_an_object_that_is_dropped_out_of_view_is_lost(self):
        trial = Trial("fls").until(10, grasp(0), Event("dropped", 0))
        assert trial["lost"] == 0
        trial.now.things_seen = np.array([False, True, False])
        assert trial.until(11)["lost"] == 1
        trial.until(40, *over(), *back())
        assert trial["score"] == pytest.approx(300 - 30 - 100 / 3)
        assert trial["proficient"] == 0

    def test_it_is_cut_off_at_300_s(self):
        trial = Trial("fls").until(10, grasp(0)).until(311)
        assert (trial["time"], trial["score"], trial["proficient"]) == (300.0, 0.0, 0.0)

    def test_it_needs_a_board_and_a_camera(self):
        assert Trial("fls", is_board=False).until(10)["score"] is None
        assert Trial("fls", camera=False).until(10)["lost"] is None


class TestMScore:
    METRICS = (
        ScoreValue(name="completion_time", value=30.0, unit="s"),
        ScoreValue(name="PSM1/economy", value=0.5),
        ScoreValue(name="drops", reason="no objects"),
    )

    def passed(self, **benchmarks):
        rules = RULES["mscore"](setting(benchmarks=benchmarks))
        found = {one.name: one for one in rules.values({one.name: one for one in self.METRICS})}
        return None if found["passed"].reason else found["passed"].value

    def test_every_metric_has_to_pass(self):
        assert self.passed(completion_time=40.0, **{"PSM1/economy": 0.4}) == 1
        assert self.passed(completion_time=20.0, **{"PSM1/economy": 0.4}) == 0
        assert self.passed(completion_time=40.0, **{"PSM1/economy": 0.6}) == 0

    def test_none_can_be_said_without_benchmarks_or_of_a_metric_without_a_value(self):
        assert self.passed() is None
        assert self.passed(drops=1.0) is None
