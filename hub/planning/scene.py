"""What a scenario states once for all participants: the arms, the instruments, what lies on the table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

from hub.participant import Params
from hub.planning.scenario_source import Source
from schemas.errors import ScenarioError, did_you_mean

__all__ = ["spread_scene"]


def spread_scene(source: Source, models: Mapping[str, type[Params]]) -> None:
    """Give every participant the parts of `scene` that its kind has as parameters.

    What a participant states itself goes before the scene; of mappings, entry by entry. `null` keeps a part
    of the scene out. `models`: the parameters of each participant's kind. Raises ScenarioError for a part that no participant has.
    """
    if "scene" not in source.tree:
        return
    scene = source.tree.pop("scene")
    if not isinstance(scene, dict):
        raise ScenarioError("the scene is a mapping of parameters", path=("scene",))
    participants = cast("dict[str, dict[str, Any]]", source.tree["participants"]) if models else {}
    for part, value in cast("dict[str, Any]", scene).items():
        takers = [name for name, model in models.items() if part in model.model_fields]
        if not takers:
            known = {field for model in models.values() for field in model.model_fields}
            raise ScenarioError(
                f"no participant has a parameter '{part}'.{did_you_mean(part, known)}", path=("scene", part)
            )
        for name in takers:
            spec = participants[name]
            if part in spec and spec[part] is None:
                del spec[part]
                continue
            spec[part] = _merged(value, spec[part]) if part in spec else value
            source.stands_also_at(("scene", part), ("participants", name, part))


def _merged(scene: Any, own: Any) -> Any:
    if not (isinstance(scene, dict) and isinstance(own, dict)):
        return own
    first, second = cast("dict[str, Any]", scene), cast("dict[str, Any]", own)
    return first | {
        key: _merged(first[key], value) if key in first else value for key, value in second.items()
    }
