import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from learning.sweeps.trial import plan_trials
from learning.sweeps.variation import Variation, number_and_unit, parse
from schemas.errors import ScenarioError


@pytest.mark.parametrize(
    ("text", "path", "values", "unit"),
    [
        ("a.b=5 kPa..50 kPa:10", "a.b", tuple(f"{v} kPa" for v in range(5, 51, 5)), "kPa"),
        ("a=5..50 kPa:2", "a", ("5 kPa", "50 kPa"), "kPa"),
        ("a = 0.2..0.4:3", "a", (0.2, 0.3, 0.4), ""),
        ("a=1..3:3", "a", (1, 2, 3), ""),
        ("a=1e-3 m..-2e-3 m:4", "a", ("0.001 m", "0 m", "-0.001 m", "-0.002 m"), "m"),
        ("a=5 N/m..6 N/m:2", "a", ("5 N/m", "6 N/m"), "N/m"),
        ("a=1 mm, 2 mm", "a", ("1 mm", "2 mm"), "mm"),
        ("a=1 mm, 2 cm", "a", ("1 mm", "2 cm"), None),
        ("a=mujoco,fmu", "a", ("mujoco", "fmu"), None),
        ("a=[1, 2], [3, 4]", "a", ([1, 2], [3, 4]), None),
        ("a=[x, y]", "a", ("x", "y"), None),
        ("a=true,false", "a", (True, False), None),
    ],
)
def test_reads(text, path, values, unit):
    assert parse(text) == Variation(path, values)
    assert parse(text).unit == unit


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a", "expected PATH="),
        ("=1..2:3", "expected PATH="),
        ("a=1..2", "is not a range"),
        ("a=1..2:x", "is not a range"),
        ("a=1 mm..2 cm:3", "both ends need the same unit"),
        ("a=1 mm..2:3", "both ends need the same unit"),
        ("a=1..2:1", "1 values, allowed are 2 to 10000"),
        ("a=1..2:99999999999999", "values, allowed are 2 to 10000"),
        ("a={", "is not a list of YAML values"),
        ("a=[]", "0 values"),
    ],
)
def test_rejects(text, says):
    with pytest.raises(ScenarioError, match=says):
        parse(text)


finite = st.floats(-1e6, 1e6).map(lambda x: float(f"{x:.9g}"))


@given(finite, finite, st.integers(2, 40), st.sampled_from(["", "mm", "kPa", "N/m"]))
def test_a_range_is_evenly_spaced(first, last, count, unit):
    variation = parse(f"a={first!r} {unit}..{last!r} {unit}:{count}")
    found = [number_and_unit(value) for value in variation.values]
    assert {each[1] for each in found} == {unit}
    np.testing.assert_allclose(
        [each[0] for each in found],
        np.linspace(first, last, count),
        rtol=1e-11,
        atol=1e-11 * abs(first - last),
    )


def test_all_combinations_with_repetitions():
    trials = plan_trials([parse("a=1,2"), parse("b=x,y,z")], 2, "seed")
    assert [trial.number for trial in trials] == list(range(12))
    assert [tuple(trial.settings.values()) for trial in trials[:4]] == [
        (1, "x", 0),
        (1, "x", 1),
        (1, "y", 0),
        (1, "y", 1),
    ]
    assert {trial.repetition for trial in trials} == {0, 1}
    assert len({tuple(trial.settings.items()) for trial in trials}) == 12
