import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from hub.observation.measures import Measures
from schemas.ros import Float64Message
from schemas.scenario import Measure, Scenario
from tests.hub.parts import Part, out, plan_of
from tests.strategies import vectors

WRENCH = "geometry_msgs/msg/WrenchStamped"
KINDS = ("peak", "peak-norm", "least", "mean", "final", "drop", "swing")


def measures(of, part):
    measure = {
        kind.replace("-", "_"): {"kind": kind, "of": of, "live": kind == "final", "unit": "N"}
        for kind in KINDS
    }
    scenario = Scenario.model_validate(
        {"name": "m", "step": "1 ms", "participants": {"a": {"kind": "part"}}, "measure": measure}
    )
    return Measures(scenario, plan_of(part, measure=measure))


@given(st.lists(vectors(6).map(np.tanh), min_size=1, max_size=8))
def test_of_a_field_of_several_numbers_the_norm_is_measured(values):
    found = measures("a.out.force", Part("a", out(type=WRENCH)))
    for value in values:
        found.add("a", "out", value, 0)
    norms = [np.linalg.norm(value[:3]) for value in values]
    drop = max(norms) - min(norms[np.argmax(norms) :])
    swing = np.ptp([value[:3] for value in values], axis=0).max()
    expected = {
        "peak": max(norms),
        "peak_norm": max(norms),
        "least": min(norms),
        "mean": np.mean(norms),
        "final": norms[-1],
        "drop": drop,
        "swing": swing,
    }
    assert found.results() == pytest.approx(expected)
    assert found.live() == {"final": (pytest.approx(norms[-1]), "N")}


@given(st.lists(vectors(1).map(np.tanh), min_size=1, max_size=8))
def test_a_single_number_keeps_its_sign_unless_the_norm_is_asked_for(values):
    found = measures("a.out", Part("a", out()))
    for value in values:
        found.add("a", "out", value, 0)
    numbers = np.concatenate(values)
    expected = {
        "peak": numbers.max(),
        "peak_norm": np.abs(numbers).max(),
        "least": numbers.min(),
        "mean": numbers.mean(),
        "final": numbers[-1],
    }
    expected |= {"swing": np.ptp(numbers)}
    expected["drop"] = numbers.max() - numbers[numbers.argmax() :].min()
    assert found.results() == pytest.approx(expected)


def test_the_time_above_a_level_is_that_of_the_longest_stretch():
    measure = {"held_s": {"kind": "time-above", "of": "a.out", "level": 0.5}}
    part = Part("a", out(period_ns=4_000_000))
    scenario = Scenario.model_validate(
        {"name": "m", "step": "1 ms", "participants": {"a": {"kind": "part"}}, "measure": measure}
    )
    found = Measures(scenario, plan_of(part, measure=measure))
    for value in (0.6, 0.6, 0.4, 0.5, 0.6, 0.7, 0.1):
        found.add("a", "out", np.array([value]), 0)
    assert found.results() == {"held_s": pytest.approx(0.012)}


def test_values_before_a_time_do_not_count():
    measure = {
        "late": {"kind": "peak", "of": "a.out", "after": "2 s"},
        "never": {"kind": "mean", "of": "a.out", "after": "9 s"},
    }
    scenario = Scenario.model_validate(
        {"name": "m", "step": "1 ms", "participants": {"a": {"kind": "part"}}, "measure": measure}
    )
    found = Measures(scenario, plan_of(Part("a", out()), measure=measure))
    for second, value in enumerate((5.0, 4.0, 3.0, 1.0, 2.0)):
        found.add("a", "out", np.array([value]), second * 10**9)
    assert found.results() == {"late": 3.0, "never": None}
    assert found.missing() == {"never": "'a.out' published no value after 9 s"}


@pytest.mark.parametrize("measure", [{"kind": "time-above"}, {"kind": "peak", "level": 1.0}])
def test_a_level_belongs_to_time_above(measure):
    with pytest.raises(ValidationError, match="a level is required for time-above"):
        Measure.model_validate({"of": "a.out", **measure})


def test_a_port_that_never_spoke_has_no_measure_and_this_is_said():
    found = measures("a.out", Part("a", out()))
    assert set(found.results().values()) == {None}
    assert found.missing() == dict.fromkeys(found.results(), "'a.out' published no value")


def test_the_events_of_a_port_are_measured_one_by_one():
    found = measures("a.out", Part("a", out(type=Float64Message.ros_type, variability="event")))
    assert (found.live(), found.results()["final"]) == ({}, None)
    for number in (3.0, -1.0, 2.0):
        found.add("a", "out", Float64Message(data=number), 0)
    results = found.results()
    assert [results[kind] for kind in ("peak", "least", "final", "swing")] == [3.0, -1.0, 2.0, 4.0]
    assert found.live() == {"final": (2.0, "N")}
