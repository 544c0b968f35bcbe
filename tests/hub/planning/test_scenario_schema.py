import json
from pathlib import Path

import pytest
from jsonschema import Draft7Validator
from ruamel.yaml import YAML

from hub.planning.scenario_file import installed_scenarios
from hub.planning.scenario_schema import scenario_schema


@pytest.fixture(scope="module")
def validator():
    schema = json.loads(scenario_schema())
    Draft7Validator.check_schema(schema)
    return Draft7Validator(schema)


def test_the_committed_schema_is_the_present_one():
    committed = installed_scenarios()["palpation"].with_name("scenario.schema.json")
    assert committed.read_text() == scenario_schema(), "run: trocar schema > configs/scenario.schema.json"


@pytest.mark.parametrize("file", sorted(installed_scenarios().values()), ids=lambda file: file.stem)
def test_installed_scenarios_fit_the_schema(validator, file: Path):
    assert [error.message for error in validator.iter_errors(YAML(typ="safe", pure=True).load(file))] == []


@pytest.mark.parametrize(
    ("change", "path"),
    [
        ({"stepp": "1 ms"}, []),
        ({"pace": "fats"}, ["pace"]),
        ({"participants": {"tissue": {"kind": "bulet"}}}, ["participants", "tissue", "kind"]),
        (
            {"participants": {"tissue": {"kind": "bullet", "organs": {"a": {"sise": [1, 2, 3]}}}}},
            ["participants", "tissue", "organs", "a"],
        ),
        ({"participants": {"tissue": {"kind": "bullet", "organ": {}}}}, ["participants", "tissue"]),
        ({"connections": ["a.b => c.d"]}, ["connections", 0]),
    ],
)
def test_the_schema_points_at_mistakes(validator, change, path):
    scenario = {
        "name": "a",
        "step": "1 ms",
        "participants": {"stylus": {"kind": "scripted", "samples": "x"}},
    } | change
    assert path in [list(error.absolute_path) for error in validator.iter_errors(scenario)]
