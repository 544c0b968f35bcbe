"""Settings of a session in annotations: of Trocar, OMSimulator and the Open Simulation Platform.

SSP itself states no step and no algorithm.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, cast

from engines.fmu.ssp.structure import Description
from engines.fmu.ssp.xml_file import Node
from schemas.errors import ScenarioError

__all__ = [
    "ANNOTATION",
    "COMPONENT_KEYS",
    "SCENARIO_KEYS",
    "SETTINGS",
    "duration_text",
    "json_text",
    "read_settings",
    "stated_step",
    "unread_annotations",
]

ANNOTATION, SETTINGS = "trocar", "trocar:Settings"
"""Type of the annotation, and its element: a JSON object."""
SCENARIO_KEYS = (
    *("description", "step", "duration", "pace", "window", "algorithm", "order"),
    *("answer_limit", "join_limit", "measure", "outcome"),
)
"""Keys of a scenario in the annotation of a system."""
COMPONENT_KEYS = ("period", "step", "tolerance", "strict", "tunable")
"""Keys of a participant in the annotation of a component."""

_LONGEST_S = 9.2e9
_UNITS_NS = (("s", 10**9), ("ms", 10**6), ("us", 10**3), ("ns", 1))
_STEPS = {
    "com.opensimulationplatform": (("osp:Algorithm", "osp:FixedStepAlgorithm"), "baseStepSize"),
    "org.openmodelica": (
        ("oms:Annotations", "oms:SimulationInformation", "oms:FixedStepMaster"),
        "stepSize",
    ),
}
"""Element and attribute of a step in seconds, by type of the annotation."""


def read_settings(parents: Iterable[Node | None], keys: Iterable[str]) -> dict[str, Any]:
    """Return the settings in the annotations below `parents`. Raises ScenarioError for a broken one."""
    for node in _annotations(parents):
        found = node.find(SETTINGS)
        if node.get("type") != ANNOTATION or found is None:
            continue
        try:
            settings = json.loads(found.text)
        except (ValueError, RecursionError) as error:
            raise ScenarioError(f"{found.place}: the settings are no JSON: {error}") from error
        if not isinstance(settings, dict) or not settings.keys() <= set(keys):  # pyright: ignore[reportUnknownMemberType]
            raise ScenarioError(
                f"{found.place}: the settings are no object with keys among {', '.join(keys)}"
            )
        return cast("dict[str, Any]", settings)
    return {}


def stated_step(description: Description) -> tuple[float, str] | None:
    """Return the step in s stated in an annotation of another tool, and the tool. Raises ScenarioError."""
    for node in _annotations(description.annotations):
        path, attribute = _STEPS.get(node.get("type"), ((), ""))
        found = node.find(*path) if path else None
        if found and (step := found.number(attribute, 0.0)) > 0:
            return step, node.get("type")
    return None


def unread_annotations(description: Description) -> list[str]:
    """Return a sentence for each annotation that nothing is read from."""
    parents: list[Node | None] = [*description.annotations]
    parents += [one.annotations for one in description.root.components()]
    parents += [one.annotations for one in description.root.systems() if one.path]
    return [
        f"{node.place}: an annotation of type '{node.get('type')}'"
        for node in _annotations(parents)
        if node.get("type") not in {ANNOTATION, *_STEPS}
    ]


def _annotations(parents: Iterable[Node | None]) -> Iterable[Node]:
    for parent in parents:
        yield from parent.all("ssc:Annotation") if parent else ()


def duration_text(seconds: float) -> str:
    """Return a time as whole nanoseconds in the largest unit of a whole number, such as `2500 us`.

    Raises ScenarioError for a time beyond 292 years, 64 bits of nanoseconds.
    """
    if abs(seconds) > _LONGEST_S:
        raise ScenarioError(
            f"a time of {seconds:g} s is longer than {_LONGEST_S:g} s, 64 bits of nanoseconds"
        )
    ns = round(seconds * 1e9)
    unit, size = next((unit, size) for unit, size in _UNITS_NS if ns % size == 0)
    return f"{ns // size} {unit}"


def json_text(settings: Mapping[str, Any]) -> str:
    """Return settings as the text of the element."""
    return json.dumps(settings, default=str, ensure_ascii=True)
