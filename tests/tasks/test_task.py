"""Tasks as participants: the contract, what they refuse, and a trial that is known."""

import numpy as np
import pytest

from hub.participant import Inputs, Setup
from hub.testing import check_engine
from schemas.errors import ScenarioError
from schemas.ros import BoolMessage, Header
from schemas.trocar_msgs import TissueEvent
from tasks.hand_over import HandOverTask
from tasks.params import TaskParams
from tasks.peg_board import PegBoardParams, PegBoardTask
from tasks.pick_and_place import PickAndPlaceParams, PickAndPlaceTask
from tasks.practice import PracticeTask

PERIOD_NS = 10_000_000
ARMS = {
    "PSM1": {"position": [-0.06, 0.0, 0.2]},
    "PSM2": {"position": [0.06, 0.0, 0.2]},
    "ECM": {"position": [0.0, -0.1, 0.2]},
}
SCENE = {"arms": ARMS, "objects": {"one": {}, "two": {}}}
BOARD = {"board": {"kind": "board", "board": "icra2026", "position": [0.0, 0.0, 0.0]}}
DISHES = {name: {"kind": "dish", "position": [x, 0.0, 0.0]} for name, x in (("left", -0.1), ("right", 0.1))}
NO_TURN = [0.0, 0.0, 0.0, 1.0]


def hand_over(**changes):
    return HandOverTask("task", TaskParams.model_validate(SCENE | changes))


def practice(**changes):
    return PracticeTask("task", TaskParams.model_validate({"arms": ARMS} | changes))


def peg_board(**changes):
    return PegBoardTask("task", PegBoardParams.model_validate(SCENE | {"fixtures": BOARD} | changes))


def dishes(**changes):
    goals = {"one": "left", "two": "right"}
    params = SCENE | {"fixtures": DISHES, "goals": goals} | changes
    return PickAndPlaceTask("task", PickAndPlaceParams.model_validate(params))


def cut(kind="cut", instrument="PSM2"):
    return TissueEvent(header=Header(), kind=kind, instrument=instrument, size=2e-6, unit="m^2")


def inputs_of(task):
    """A value for every input."""
    found = {}
    for port in task.ports:
        if port.causality == "input":
            pose = [0.01, 0.02, 0.03, *NO_TURN]
            kinds = {
                "PoseStamped": pose,
                "WrenchStamped": [1.0, 2.0, 2.0, 0.0, 0.0, 0.0],
                "Bool": (BoolMessage(data=True),),
                "TissueEvent": (cut(),),
            }
            found[port.name] = kinds.get(port.type.rpartition("/")[2], [1.0])
    return found


@pytest.mark.parametrize("make", [hand_over, practice, peg_board, dishes])
def test_it_keeps_the_contract(make):
    check_engine(make, period_ns=PERIOD_NS, inputs=inputs_of(make()))


class Board:
    """A peg board with two rings, watched by its task; poses are those of the world."""

    def __init__(self, task, *, without=()):
        self.task, self.t = task, 0
        given = inputs_of(task)
        self.events_in = {name: value for name, value in given.items() if isinstance(value, tuple)}
        self.values = {
            name: np.array(given[name], np.float64) for name in given if name not in self.events_in
        }
        self.values["tools/impulse"] = self.values["fixtures/impulse"] = np.zeros(1)
        connected = frozenset(given) - frozenset(without)
        self.outputs = task.configure(Setup(PERIOD_NS, None, connected=connected))
        self.events = []
        for i, thing in enumerate(("one", "two")):
            self.put(thing, task.goals.positions[3 + i], 0)

    def put(self, thing, position, holder):
        self.values[f"{thing}/pose"] = np.array([*position, *NO_TURN])
        self.values[f"{thing}/held_by"] = np.array([float(holder)])
        return self

    def wait(self, seconds=0.3):
        for _ in range(round(seconds * 1e9 / PERIOD_NS)):
            self.outputs = self.task.step(self.t, PERIOD_NS, Inputs(self.values, events=self.events_in))
            self.events += [event.event for event in self.outputs["events"]]
            self.t += PERIOD_NS
        return self

    def carry(self, thing, post):
        above = self.task.goals.positions[post] + [0.0, 0.0, 0.05]
        self.wait(0.1).put(thing, self.values[f"{thing}/pose"][:3], 1).wait(0.1).put(thing, above, 1).wait(
            0.1
        )
        self.put(thing, above, 2).wait(0.1).put(thing, self.task.goals.positions[post], 2).wait(0.1)
        return self.put(thing, self.task.goals.positions[post], 0).wait()

    @property
    def card(self):
        return self.task.card(self.t)

    def metric(self, name):
        value = {one.name: one for one in self.card.metrics}[name]
        return value.reason or value.value


def test_rings_over_the_wall():
    board = Board(peg_board(), without=("ECM/measured_cp",)).carry("one", 9)
    assert board.events == ["grasped", "lifted", "handed over", "placed"]
    assert board.outputs["progress"][0] == 0.5
    board.carry("two", 10)
    assert board.outputs["done"][0] == 1.0
    assert (board.card.goals, board.card.reached) == (2, 2)
    assert board.metric("completion_time") == pytest.approx(board.t / 1e9 - 0.2, abs=0.02)
    assert (board.metric("grasps"), board.metric("hand_overs"), board.metric("drops")) == (2, 2, 0)
    points = {rule.rules: rule.values[0].value for rule in board.card.rules}
    assert points["icra2026"] == 2


def test_metrics_end_with_the_task():
    board = Board(peg_board()).carry("one", 9).carry("two", 10)
    before = board.card.metrics
    board.values["PSM1/measured_cp"][:3] += 0.1
    assert board.wait(1.0).card.metrics == before


def test_rings_over_the_wall_and_back():
    board = Board(peg_board(legs=2)).carry("one", 9).carry("two", 10)
    assert (board.outputs["done"][0], board.outputs["progress"][0]) == (0.0, 0.5)
    board.carry("one", 3).carry("two", 4)
    assert (board.outputs["done"][0], board.card.goals) == (1.0, 4)
    points = {rule.rules: rule.values[0].value for rule in board.card.rules}
    assert points["icra2026"] == 4


def test_without_an_end_there_is_no_share_of_the_goals():
    board = Board(peg_board(legs=None)).carry("one", 9).carry("two", 10).carry("one", 3)
    assert (board.outputs["done"][0], board.card.goals, board.card.reached) == (0.0, 0, 3)


def test_instruments_that_touch_fixtures_again_after_a_pause_have_touched_twice():
    board = Board(peg_board()).wait(0.5)
    assert (board.metric("fixture_collisions"), board.metric("fixture_impulse")) == (0, 0.0)
    for more, seconds in ((0.01, 0.05), (0.02, 0.3), (0.5, 0.1)):
        board.values["fixtures/impulse"] = board.values["fixtures/impulse"] + more
        board.wait(seconds)
    assert (board.metric("fixture_collisions"), board.metric("fixture_impulse")) == (2, pytest.approx(0.53))
    unknown = Board(peg_board(), without=("fixtures/impulse",)).wait(0.1)
    assert "fixtures/impulse" in unknown.metric("fixture_collisions")
    without = practice()
    without.configure(Setup(PERIOD_NS, None))
    assert "fixture_collisions" not in {metric.name for metric in without.card(0).metrics}


def test_changes_of_tissue_are_events_of_a_practice():
    task = practice()
    given = inputs_of(task)
    events = {name: value for name, value in given.items() if isinstance(value, tuple)}
    events["tissue/events"] = (cut(), cut("torn", "forceps"), cut("swollen"))
    values = {name: np.array(value) for name, value in given.items() if name not in events}
    task.configure(Setup(PERIOD_NS, None))
    found = task.step(0, PERIOD_NS, Inputs(values, events=events))["events"]
    found = [one for one in found if one.event != "collision"]
    assert [(one.event, one.arm) for one in found] == [("cut", "PSM2"), ("torn", "")]
    assert (found[0].value, found[0].unit) == (2e-6, "m^2")


def test_a_ring_beside_its_post_is_not_on_it():
    task = peg_board()
    task.configure(Setup(PERIOD_NS, None))
    x, y, z = task.goals.positions[9]
    for pose, post in (
        ([x, y, z, *NO_TURN], 9),
        ([x + 0.0040, y, z, *NO_TURN], 9),
        ([x + 0.0045, y, z, *NO_TURN], -1),
        ([x, y, z + 0.02, *NO_TURN], -1),
        ([x, y, z, 0.7071, 0.0, 0.0, 0.7071], -1),
    ):
        assert task.place_of(0, np.array(pose)) == post


def test_pieces_in_and_beside_dishes():
    task = dishes()
    assert task.place_of(0, np.array([-0.1, 0.02, 0.01, *NO_TURN])) == 0
    assert task.place_of(0, np.array([-0.1, 0.03, 0.01, *NO_TURN])) == -1
    assert task.place_of(0, np.array([0.1, 0.0, 0.05, *NO_TURN])) == -1


def test_what_is_not_connected_has_no_number_but_a_reason():
    board = Board(peg_board(), without=("tools/impulse", "PSM1/following", "ECM/measured_cp")).wait(1.0)
    assert "tools/impulse" in board.metric("tool_collisions")
    assert "PSM1/following" in board.metric("PSM1/clutch_count")
    assert board.metric("PSM2/clutch_count") == 0
    assert "ECM/measured_cp" in board.metric("PSM1/out_of_view_time")
    assert board.metric("PSM1/peak_force") == 6.0  # of both wrenches together


def test_a_hand_that_lets_go_has_clutched():
    board = Board(peg_board()).wait(0.1)
    board.events_in["PSM1/following"] = (BoolMessage(data=False),)
    assert board.wait(0.1).metric("PSM1/clutch_count") == 1


@pytest.mark.parametrize(
    ("changes", "hint"),
    [
        ({"rules": ["icra206"]}, "Did you mean 'icra2026'?"),
        ({"benchmarks": {"PSM1/path_lenght": 1.0}}, "Did you mean 'PSM1/path_length'?"),
    ],
)
def test_names_that_do_not_exist_are_refused_with_the_nearest_one(changes, hint):
    with pytest.raises(ScenarioError, match="unknown") as error:
        hand_over(**changes)
    assert hint in str(error.value)


def test_a_peg_board_task_needs_one_board():
    with pytest.raises(ValueError, match="has 0 boards"):
        peg_board(fixtures={})
    with pytest.raises(ValueError, match="Did you mean 'left'"):
        dishes(goals={"one": "lift"})
