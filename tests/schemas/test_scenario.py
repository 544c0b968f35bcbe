from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from schemas.scenario import Bond, Connection, ParticipantSpec, PortReference, Scenario
from tests.strategies import names

FULL: dict[str, Any] = {
    "name": "press",
    "step": "1 ms",
    "duration": "20 s",
    "pace": "realtime",
    "window": 10,
    "participants": {
        "robot": {
            "kind": "mujoco",
            "host": "robot",
            "period": "2 ms",
            "arms": {"PSM1": {"instrument": "probe"}},
        },
        "tissue": {"kind": "bullet"},
    },
    "connections": [
        "robot.PSM1/pose -> tissue.target",
        {"source": "tissue.wrench", "target": "robot.load", "extrapolation": "linear"},
    ],
    "bonds": [
        {
            "motion": "robot.PSM1/probe",
            "force": "tissue.probe",
            "algorithm": "gauss-seidel",
            "order": ["tissue", "robot"],
        }
    ],
    "measure": {"peak_n": {"kind": "peak-norm", "of": "tissue.probe/wrench.force", "live": True}},
}

durations = st.integers(1, 10**12).map(lambda ns: f"{ns} ns")
endpoints = st.tuples(names, names, names).map(lambda parts: f"{parts[0]}.{parts[1]}/{parts[2]}")


@st.composite
def scenarios(draw: st.DrawFn) -> dict[str, Any]:
    return {
        "name": draw(names),
        "step": draw(durations),
        "duration": draw(st.none() | durations),
        "window": draw(st.integers(1, 1000)),
        "participants": draw(
            st.dictionaries(
                names,
                st.fixed_dictionaries(
                    {"kind": st.text(max_size=5)}, optional={"period": durations, "mass": st.integers()}
                ),
                min_size=1,
            )
        ),
        "connections": draw(st.lists(st.tuples(endpoints, endpoints).map(" -> ".join), max_size=3)),
        "bonds": draw(st.lists(st.fixed_dictionaries({"motion": endpoints, "force": endpoints}), max_size=2)),
    }


@given(scenarios())
def test_json_round_trip(tree: dict[str, Any]) -> None:
    scenario = Scenario.model_validate(tree)
    assert Scenario.model_validate_json(scenario.model_dump_json()) == scenario


def test_a_full_scenario() -> None:
    scenario = Scenario.model_validate(FULL)
    assert Scenario.model_validate_json(scenario.model_dump_json()) == scenario
    assert (scenario.step, scenario.duration, scenario.participants["robot"].period) == (
        10**6,
        20 * 10**9,
        2 * 10**6,
    )
    assert scenario.participants["robot"].params == {"arms": {"PSM1": {"instrument": "probe"}}}
    assert scenario.connections[0] == Connection(
        source=PortReference(participant="robot", port="PSM1/pose"),
        target=PortReference(participant="tissue", port="target"),
    )
    assert scenario.bonds[0].name == "robot/PSM1/probe"
    assert str(scenario.measure["peak_n"].of) == "tissue.probe/wrench.force"


@pytest.mark.parametrize("part", ["connections", "bonds", "measure"])
def test_an_empty_section_is_none_of_them(part: str) -> None:
    assert not getattr(Scenario.model_validate(FULL | {part: None}), part)


@pytest.mark.parametrize(
    "change",
    [
        {"name": "a b"},
        {"step": 0},
        {"step": "-1 ms"},
        {"step": "1 m"},
        {"duration": 0},
        {"window": 0},
        {"window": 1001},
        {"pace": "slow"},
        {"participants": {}},
        {"participants": {"a/b": {"kind": "x"}}},
        {"participants": {"a": {}}},
        {"participants": {"a": {"kind": "x", "host": "a b"}}},
        {"connections": ["robot.a tissue.b"]},
        {"connections": ["robot -> tissue.b"]},
        {"connections": [".a -> tissue.b"]},
        {"connections": [{"source": "a.b", "target": "c.d", "extrapolation": "cubic"}]},
        {"connections": ["a.* -> c.d"]},
        {"connections": ["a.b -> c.*"]},
        {"connections": ["a.*/b -> c.*/b"]},
        {"connections": ["a.** -> c.**"]},
        {"bonds": [{"motion": "a.b"}]},
        {"bonds": [{"motion": "a.b", "force": "c.d", "algorithm": "magic"}]},
        {"measure": {"peak n": {"kind": "peak", "of": "a.b"}}},
        {"extra": 1},
    ],
)
def test_what_is_wrong_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Scenario.model_validate(FULL | change)


def test_defaults() -> None:
    bond = Bond.model_validate({"motion": "a.b", "force": "c.d"})
    assert (bond.algorithm, bond.prediction, bond.check) == ("impulse", "velocity", "refuse")
    assert ParticipantSpec(kind="x").params == {}
