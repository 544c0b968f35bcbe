"""The suturing task and the rules of the challenge, held against ways of the needle that are known."""

from math import pi

import numpy as np
import pytest
from pydantic import ValidationError

from hub.participant import Inputs, Setup
from hub.testing import check_engine
from robots import rotation
from robots.training.needles import NEEDLES
from robots.training.phantoms import PHANTOMS
from schemas.ros import BoolMessage, Header
from schemas.trocar_msgs import TaskEvent
from tasks.rules import GENERAL
from tasks.suturing import SuturingParams, SuturingTask

PERIOD_NS = 10_000_000
HEADER = Header(frame_id="world")
NEEDLE, PHANTOM = NEEDLES["sh-plus"], PHANTOMS["branch-top"]
SCENE = {
    "arms": {"PSM1": {"position": [0.06, 0.0, 0.2]}, "PSM2": {"position": [-0.06, 0.0, 0.2]}},
    "fixtures": {"phantom": {"kind": "phantom", "phantom": "branch-top", "position": [0.0, 0.0, 0.0]}},
    "objects": {"needle": {"kind": "needle", "position": [0.0, 0.0, 0.05]}},
}


def suturing(**changes):
    return SuturingTask("task", SuturingParams.model_validate(SCENE | changes))


def inputs_of(task):
    kinds = {
        "PoseStamped": [0.01, 0.02, 0.03, 0.0, 0.0, 0.0, 1.0],
        "WrenchStamped": [1.0, 2.0, 2.0, 0.0, 0.0, 0.0],
        "Bool": (BoolMessage(data=True),),
        "TaskEvent": (
            TaskEvent(header=HEADER, event="entered", object="needle", place="entry1", value=0.8, unit="N"),
        ),
        "Float64MultiArray": [0.0, 0.0, 0.0],
    }
    ports = [port for port in task.ports if port.causality == "input"]
    return {port.name: kinds.get(port.type.rpartition("/")[2], [1.0]) for port in ports}


def test_it_keeps_the_contract():
    check_engine(suturing, period_ns=PERIOD_NS, inputs=inputs_of(suturing()))


class Trial:
    """A needle that is led through the holes; `aside` moves it off its way (m)."""

    def __init__(self, *without, **changes):
        self.task, self.t = suturing(**changes), 0
        given = inputs_of(self.task)
        self.values = {name: np.array(value) for name, value in given.items() if not isinstance(value, tuple)}
        connected = frozenset(given) - frozenset(without)
        self.task.configure(Setup(PERIOD_NS, None, connected=connected))

    def at(self, angle, row, aside=(0.0, 0.0, 0.0), **events):
        x, y = PHANTOM.entries[row, :2, 3]
        turn, height = angle - NEEDLE.arc / 2, (NEEDLE.radius**2 - x**2) ** 0.5
        axes = np.array([[np.cos(turn), -np.sin(turn), 0], [0, 0, 1], [-np.sin(turn), -np.cos(turn), 0]])
        place = np.array([0.0, y, height]) + aside
        self.values["needle/pose"] = np.concatenate([place, rotation.from_matrix(axes)])
        out = self.task.step(self.t, PERIOD_NS, Inputs(self.values, events=events))
        self.t += PERIOD_NS
        return out

    def stitch(self, row, aside=(0.0, 0.0, 0.0), emerge=0.7):
        for angle in np.arange(pi / 4 - 0.3, 3 * pi / 4 + emerge, 0.02):
            self.at(angle, row, aside)
        return self

    def rules(self, name):
        card = self.task.card(self.t)
        values = next(one for one in card.rules if one.rules == name).values
        return {value.name: None if value.reason else value.value for value in values}


def test_a_stitch_counts_by_script_and_page_with_its_distances():
    trial = Trial("report", "estimate/pose").stitch(1, aside=(0.0, 1e-3, 0.0))
    for name in ("src2-script", "src2-rules"):
        found = trial.rules(name)
        assert found["success"] == 1.0
        assert found["entry_lateral"] == pytest.approx(1e-3, abs=0.1e-3)
        assert found["exit_lateral"] == pytest.approx(1e-3, abs=0.1e-3)
        assert found["axial"] >= 5e-3
    assert trial.rules("src3-script")["success"] == 0.0


def test_three_millimetres_beside_the_hole_are_enough_for_the_script_alone():
    trial = Trial("report", "estimate/pose").stitch(1, aside=(0.0, 3e-3, 0.0))
    assert trial.rules("src2-script")["success"] == 1.0
    assert trial.rules("src2-rules")["success"] == 0.0
    assert Trial("report", "estimate/pose").stitch(1, (0.0, 6e-3, 0.0)).rules("src2-script")["success"] == 0.0


def test_a_way_back_through_the_holes_is_no_stitch():
    trial = Trial("report", "estimate/pose")
    for angle in np.arange(3 * pi / 4 + 0.7, pi / 4 - 0.3, -0.02):
        trial.at(angle, 0)
    assert trial.rules("src2-script")["success"] == 0.0


def test_a_report_ends_it_whether_it_counts_or_not():
    early = Trial("estimate/pose")
    early.at(pi / 2, 0, report=(BoolMessage(data=True),))
    early.stitch(0)
    assert early.rules("src2-script") == pytest.approx(early.rules("src2-script") | {"success": 0.0})
    late = Trial("estimate/pose").stitch(0)
    assert late.rules("src2-script")["time"] is None
    late.at(3 * pi / 4 + 0.7, 0, report=(BoolMessage(data=True),))
    assert late.rules("src2-script")["success"] == 1.0


def test_four_stitches_count_in_their_order_only():
    trial = Trial("report", "estimate/pose")
    for row in range(4):
        assert trial.rules("src3-script")["success"] == 0.0
        trial.stitch(row)
    assert trial.rules("src3-script")["success"] == 1.0
    assert trial.rules("src3-rules")["success"] == 1.0
    turned = Trial("report", "estimate/pose")
    for row in (0, 2, 1, 3):
        turned.stitch(row)
    assert turned.rules("src3-script")["success"] == 0.0


def test_the_error_of_an_estimate_is_the_sum_over_base_mid_and_tip():
    trial = Trial()
    trial.at(pi / 2, 0)
    trial.values["estimate/pose"] = trial.values["needle/pose"] + [1e-3, 0, 0, 0, 0, 0, 0]
    trial.at(pi / 2, 0)
    assert trial.rules("src1")["error"] == pytest.approx(3e-3)
    assert Trial("estimate/pose").rules("src1")["error"] is None


def test_goals_and_accuracy_come_from_the_tissue():
    trial = Trial("report", stitches=1)
    trial.values |= {
        "tissue/entry": PHANTOM.entries[0, :3, 3] + [0, 2e-3, 0],
        "tissue/trauma": np.array([3e-6]),
    }
    trial.at(pi / 2, 0, **{"tissue/events": (TaskEvent(header=HEADER, event="entered", place="entry1"),)})
    out = trial.at(
        pi / 2, 0, **{"tissue/events": (TaskEvent(header=HEADER, event="pulled out", place="exit1"),)}
    )
    assert [(event.event, event.place) for event in out["events"]] == [("stitched", "exit1")]
    assert out["done"][0] == 1.0
    metrics = {value.name: value.value for value in trial.task.card(trial.t).metrics}
    assert metrics["stitches/entry_error_mean"] == pytest.approx(2e-3)
    assert metrics["stitches/trauma"] == 3e-6
    assert metrics["stitches/made"] == 1.0


def test_a_scene_without_a_phantom_is_refused_and_other_tasks_keep_their_rules():
    with pytest.raises(ValidationError, match="the scene has 0 phantoms and 1 needles; one of each"):
        suturing(fixtures={})
    assert GENERAL == ("icra2026", "icra2026-live", "surrol", "fls", "mscore")
