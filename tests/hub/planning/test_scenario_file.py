from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.planning.scenario_file import installed_scenarios, load, locate_error
from hub.planning.scenario_source import read
from schemas.errors import ScenarioError
from schemas.scenario import Scenario

GOOD = """\
# yaml-language-server: $schema=scenario.schema.json
name: swinging
step: 1 ms
participants:
  one: {kind: pendulum, length: 80 mm}
  two:
    kind: pendulum
    host: other
    length: 0.5
connections:
  - one.angle -> two.goal
"""

pytestmark = pytest.mark.usefixtures("pendulum")


@pytest.fixture
def problems(tmp_path):
    def of(text, *overrides):
        file = tmp_path / "session.yaml"
        file.write_text(text)
        with pytest.raises(ScenarioError) as caught:
            load(str(file), overrides)
        return str(caught.value).replace(f"{file}:", "").splitlines()

    return of


@pytest.fixture
def good(tmp_path):
    file = tmp_path / "session.yaml"
    file.write_text(GOOD)
    return str(file)


def test_a_good_scenario(good, tmp_path):
    loaded = load(good)
    assert loaded.scenario.step == 1_000_000
    assert loaded.params["one"].length == pytest.approx(0.08)
    assert loaded.source.directory == tmp_path
    assert Scenario.model_validate_json(loaded.scenario.model_dump_json()) == loaded.scenario


def test_every_problem_is_one_line_with_its_place(problems):
    text = (
        GOOD.replace("step: 1 ms", "stepp: 1 ms")
        .replace("length: 0.5", "length: 5 kg\n    sover: euler")
        .replace("->", "=>")
    )
    assert problems(text) == [
        "2:1: step: is required but not given",
        "12:5: connections.0: 'one.angle => two.goal' is no 'participant.port -> participant.port'",
        (
            "3:1: stepp: there is no 'stepp' here. Did you mean 'step'? Known: algorithm, answer_limit,"
            " bonds, connections, description, duration, join_limit, measure, name, order, outcome,"
            " pace, participants, scene, step, window."
        ),
        (
            "9:13: participants.two.length: '5 kg' is not a quantity in m (Cannot convert from 'kilogram'"
            " ([mass]) to 'meter' ([length]))"
        ),
        (
            "10:5: participants.two.sover: there is no 'sover' here. Did you mean 'solver'? Known: host,"
            " kind, length, network_link, period, rate_limit, solver, springs."
        ),
    ]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "kind: pendulum\n",
            "kind: pendulm\n",
            "7:11: participants.two.kind: unknown kind 'pendulm'. Did you mean 'pendulum'?",
        ),
        (
            "0.5",
            "0.5\n    solver: eulr",
            (
                "10:13: participants.two.solver: 'eulr' is not allowed. Did you mean 'euler'? Known: euler,"
                " verlet."
            ),
        ),
        (
            "0.5",
            "0.5\n    springs: {a: {stiffnes: 3}}",
            (
                "10:19: participants.two.springs.a.stiffnes: there is no 'stiffnes' here. Did you mean"
                " 'stiffness'?"
            ),
        ),
        ("0.5", "-1", "9:13: participants.two.length: Input should be greater than 0 (got -1.0)"),
        ("  two:", "  2nd:", "6:3: participants.2nd: '2nd' is no name"),
        ("host: other", "host: a/b", "8:11: participants.two.host: 'a/b' is no name"),
        ("step: 1 ms", "step: 0 ms", "3:7: step: Input should be greater than 0"),
        ("    host: other\n", "    kind: pendulum\n", '8:5: not valid YAML: found duplicate key "kind"'),
        ("one: {kind", "one: {{kind", "not valid YAML"),
        (GOOD, "", "1:1: a scenario is a mapping"),
        (
            "  one: {kind: pendulum, length: 80 mm}",
            "  one:",
            "5:3: participants.one: expected a mapping, got None",
        ),
    ],
)
def test_what_was_wrong_where_and_what_was_allowed(problems, old, new, expected):
    assert old in GOOD
    assert expected in "\n".join(problems(GOOD.replace(old, new)))


def test_overrides(good):
    loaded = load(
        good,
        [
            "step=2 ms",
            "participants.one.length=3",
            "participants.two.springs.a.stiffness=4",
            "connections.0=two.angle -> one.goal",
        ],
    )
    assert loaded.scenario.step == 2_000_000
    assert loaded.params["one"].length == 3.0
    assert loaded.params["two"].springs["a"].stiffness == 4.0
    assert str(loaded.scenario.connections[0].source) == "two.angle"


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("stepp=2 ms", "--set stepp=2 ms: stepp: there is no 'stepp' here. Did you mean 'step'?"),
        (
            "participants.one.length=-3",
            "--set participants.one.length=-3: participants.one.length: Input should be greater than 0",
        ),
        (
            "participants.one.springs.a.k=4",
            "--set participants.one.springs.a.k=4: participants.one.springs.a.stiffness: is required",
        ),
        (
            "connections.1=x",
            "--set connections.1=x: connections is a list of 1, counted from 0; there is no '1' in it",
        ),
        ("name.x=1", "--set name.x=1: name is 'swinging', which has no parts"),
        ("step", "--set step: expected a.b.c=value"),
        ("step={", "--set step={: the value is not valid YAML"),
    ],
)
def test_a_wrong_override_is_named_instead_of_a_line(problems, override, expected):
    assert expected in "\n".join(problems(GOOD, override))


MERGED = """\
name: swinging
step: 1 ms
participants:
  one:
    kind: pendulum
    <<: &shape
      length: 80 mm
      springs: {a: {stiffness: 3}}
  two: {kind: pendulum, <<: *shape, length: 0.5}
  three:
    <<: [{length: 2}, *shape]
    kind: pendulum
"""


@pytest.fixture
def merged(tmp_path):
    file = tmp_path / "merged.yaml"
    file.write_text(MERGED)
    return str(file)


def test_merge_keys_give_several_participants_the_same_parameters(merged):
    params = load(merged).params
    assert [params[name].length for name in ("one", "two", "three")] == [0.08, 0.5, 2.0]
    assert [params[name].springs["a"].stiffness for name in ("one", "two", "three")] == [3.0] * 3


def test_an_override_changes_what_it_names_and_no_other_that_merges_it(merged):
    params = load(merged, ["participants.two.springs.a.stiffness=4"]).params
    assert [params[name].springs["a"].stiffness for name in ("one", "two", "three")] == [3.0, 4.0, 3.0]


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "stiffness: 3",
            "stifness: 3",
            [
                f"8:21: participants.{name}.springs.a.stifness: there is no 'stifness'"
                for name in ("one", "two", "three")
            ],
        ),
        ("80 mm", "80 kg", ["7:15: participants.one.length: '80 kg' is not a quantity in m"]),
        ("0.5", "-0.5", ["9:45: participants.two.length: Input should be greater than 0"]),
        ("length: 2", "length: -2", ["11:19: participants.three.length: Input should be greater than 0"]),
        (
            "[{length: 2}, *shape]",
            "3",
            ["11:9: not valid YAML: expected a mapping or list of mappings for merging"],
        ),
        ("*shape]", "*shpe]", ["11:23: not valid YAML: found undefined alias 'shpe'"]),
        (
            "springs: {a:",
            "springs: &s {b: *s, a:",
            ["8:16: nested too deeply: an alias (*name) is used inside its own anchor (&name)"],
        ),
    ],
)
def test_a_mistake_in_what_is_merged_is_shown_where_it_is_written(problems, old, new, expected):
    assert old in MERGED
    told = "\n".join(problems(MERGED.replace(old, new)))
    assert [line for line in expected if line not in told] == [], told


def test_installed_scenarios_are_found_by_name_only():
    assert "palpation" in installed_scenarios()
    with pytest.raises(ScenarioError, match=r"there is no scenario 'palpatoin'. Did you mean 'palpation'\?"):
        load("palpatoin")
    with pytest.raises(ScenarioError, match=r"there is no scenario file 'nowhere/palpation\.yaml'"):
        load("nowhere/palpation.yaml")


def test_a_file_in_this_directory_is_found_whatever_its_suffix(good, tmp_path, monkeypatch):
    (tmp_path / "other").mkdir()
    monkeypatch.chdir(tmp_path / "other")
    Path("mine.json").write_text(GOOD)
    assert load("mine.json").scenario == load(good).scenario


def test_an_error_of_the_wiring_gets_its_place(good):
    source = read(load(good).source.file)
    error = locate_error(ScenarioError("no such port", path=("participants", "two", "length")), source)
    assert str(error) == f"{good}:9:13: participants.two.length: no such port"
    assert str(locate_error(ScenarioError("of the whole"), source)) == "of the whole"


@given(text=st.text(alphabet=st.sampled_from("ab:{}[]-#&*!|>'\"%@` \n\t,?"), max_size=40))
def test_any_text_is_a_scenario_or_a_scenario_error(text, tmp_path_factory):
    file = tmp_path_factory.mktemp("any") / "any.yaml"
    file.write_text(text)
    with pytest.raises(ScenarioError):
        load(str(file))
