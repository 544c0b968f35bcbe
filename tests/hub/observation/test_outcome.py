"""The sentence about a run, and whether it succeeded."""

import pytest
from pydantic import ValidationError

from hub.observation.outcome import verdict
from schemas.readable import label, readable
from schemas.scenario import Scenario

SCENARIO = {
    "name": "lift",
    "step": "1 ms",
    "participants": {"robot": {"kind": "mujoco"}},
    "measure": {
        "lift_m": {"kind": "final", "of": "robot.lift", "unit": "m"},
        "hold": {"kind": "time-above", "of": "robot.lift", "level": 0.01},
    },
}


def lift(text="lifted by {lift_m}, held for {hold}", **success):
    return Scenario.model_validate(SCENARIO | {"outcome": {"text": text, "success": success}})


def test_measures_stand_in_the_sentence_with_their_units():
    found = verdict(lift(), {"lift_m": 0.02528, "hold": 12.0}, {})
    assert found == ("lifted by 25.28 mm, held for 12 s", None)
    assert verdict(lift("{{{hold}}}"), {"lift_m": None, "hold": None}, {}).text == "{an unknown value}"


@pytest.mark.parametrize(
    ("limits", "value", "succeeded"),
    [
        ({"least": 0.02}, 0.02, True),
        ({"least": 0.02}, 0.0199, False),
        ({"most": 0.02}, 0.03, False),
        ({"least": 0.01, "most": 0.02}, 0.015, True),
        ({}, None, False),
    ],
)
def test_success_is_all_measures_within_their_limits(limits, value, succeeded):
    found = verdict(lift(lift_m=limits, hold={"least": 1.0}), {"lift_m": value, "hold": 1.0}, {})
    assert found.succeeded is succeeded


@pytest.mark.parametrize("text", ["{height}", "{lift_m.__class__}", "{}", "{lift_m", "}"])
def test_a_sentence_of_other_things_is_refused(text):
    with pytest.raises(ValidationError):
        lift(text)


def card(reached, goals, time=None):
    return {"reached": reached, "goals": goals, "metrics": {"completion_time": {"value": time, "unit": "s"}}}


def test_without_a_sentence_the_task_says_it():
    scenario = Scenario.model_validate(SCENARIO)
    assert verdict(scenario, {}, {}) == ("", None)
    assert verdict(scenario, {}, {"task": card(2, 3)}) == ("2 of 3 goals reached", False)
    assert verdict(scenario, {}, {"task": card(1, 1, 6.5)}) == ("1 of 1 goal reached in 6.5 s", True)
    assert verdict(scenario, {}, {"task": card(0, 0)}) == ("", None)


def test_numbers_are_read_as_people_write_them():
    texts = [readable(0.02528, "m"), readable(-4.2e-5, "m"), readable(12.0, "s"), readable(0.0, "N")]
    assert texts == ["25.28 mm", "-0.042 mm", "12 s", "0 N"]
    assert readable(0.0698, "N") == "69.8 mN"
    assert readable(123456.7) == "123457"
    assert readable(float("nan"), "m") == "nan m"
    assert (label("lift_m", "m"), label("pull_force_n", "N"), label("steps_done", "")) == (
        "lift",
        "pull force",
        "steps done",
    )
