from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
from pydantic import BaseModel, Field, FilePath, StringConstraints, model_validator

from hub.participant import Params
from hub.planning import registry
from hub.planning.parameter_paths import parameter_paths


class Skin(BaseModel):
    kind: Literal["skin"]
    picture: Path | None = None


class Bone(BaseModel):
    kind: Literal["bone"]
    mesh: FilePath


class Everything(Params):
    model: Path
    name: str = ""
    parts: dict[Annotated[str, StringConstraints(pattern=r"^[a-z]+$")], Skin] = Field(default={})
    either: Annotated[Skin | Bone, Field(discriminator="kind")] | None = None
    pair: tuple[Path, str, Path] | None = None
    more: list[Path | Skin] = Field(default=[])
    free: dict[str, Any] = Field(default={})

    @model_validator(mode="before")
    @classmethod
    def _read(cls, data: Any) -> Any:
        raise AssertionError("nothing is validated")


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ({"model": "a", "name": "b"}, {"a"}),
        ({"parts": {"one": {"kind": "skin", "picture": "a"}, "two": {"picture": "b"}}}, {"a", "b"}),
        ({"either": {"kind": "bone", "mesh": "a", "picture": "b"}}, {"a", "b"}),
        ({"pair": ["a", "b", "c"]}, {"a", "c"}),
        ({"more": ["a", {"picture": "b", "kind": "c"}]}, {"a", "b"}),
        ({"model": 1, "more": "a", "parts": ["b"], "free": {"x": "c"}, "unknown": {"x": "d"}}, set()),
    ],
)
def test_every_text_where_the_model_has_a_path(values: dict[str, Any], expected: set[str]) -> None:
    assert parameter_paths(Everything, values) == expected


@pytest.mark.parametrize(
    ("kind", "params"),
    [
        ("fmu", {"path": "x"}),
        ("bullet", {"organs": {"liver": {"mesh": "x", "unit": "mm"}}}),
        ("scripted", {"samples": "x"}),
        ("touch", {"library": "x", "styluses": {"right": {}}}),
        ("libovr", {"library": "x"}),
        ("ros-bag", {"bag": "x"}),
        ("ros2-zenoh", {"robot_description": "x"}),
    ],
)
def test_the_files_of_installed_kinds(kind: str, params: dict[str, Any]) -> None:
    assert parameter_paths(registry.load(kind).params_model, params) == {"x"}


def test_parameters_of_native_code_exist() -> None:
    for kind in registry.kinds():
        model = registry.load(kind).params_model
        assert set(model.native_code) <= set(model.model_fields), kind
