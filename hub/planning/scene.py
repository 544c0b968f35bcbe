"""The scene of a scenario: parameters stated once for all participants, such as arms, table and objects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, cast

from hub.participant import Params
from hub.planning.limits import MAX_SCENE_VALUES, safe_text
from hub.planning.scenario_source import Source, merge_missing
from schemas.errors import ScenarioError, did_you_mean

__all__ = ["spread_scene"]


def spread_scene(source: Source, models: Mapping[str, type[Params]]) -> Iterator[ScenarioError]:
    """Give every participant the parts of `scene` named like parameters of the kind; yield the problems.

    A participant's own value has priority over the scene's; mappings are merged entry by entry, and an own
    value of null keeps a part of the scene out.

    Args:
        source: The scenario; `scene` is removed.
        models: The parameters of each participant's kind; a participant of an unknown kind is left out.
    """
    scene = source.tree.pop("scene", None)
    if scene is None:
        return
    if not isinstance(scene, dict):
        yield ScenarioError(
            f"expected a mapping of parameters, got {safe_text(repr(scene))}", path=("scene",)
        )
        return
    given = source.tree.get("participants")
    participants = cast("dict[str, dict[str, Any]]", given if isinstance(given, dict) else {})
    spread = 0
    for part, value in cast("dict[str, Any]", scene).items():
        takers = [name for name, model in models.items() if part in model.model_fields]
        # a participant of an unknown kind, which is reported elsewhere, may have the parameter
        if not takers and len(models) == len(participants) > 0:
            known = {field for model in models.values() for field in model.model_fields}
            problem = f"no participant has a parameter '{part}'.{did_you_mean(str(part), known)}"
            yield ScenarioError(problem, path=("scene", part))
        spread += len(takers) * _count_values(value)
        if spread > MAX_SCENE_VALUES:
            problem = (
                f"{len(takers)} participants take this part of the scene, which makes {spread} values with"
                f" the parts before it; at most {MAX_SCENE_VALUES} are allowed"
            )
            yield ScenarioError(problem, path=("scene", part))
            return
        for name in takers:
            own = participants[name]
            if part in own and own[part] is None:
                del own[part]
            else:
                own[part] = merge_missing(value, own[part]) if part in own else value
                source.stands_also_at(("scene", part), ("participants", name, part))


def _count_values(value: Any) -> int:
    """Return the number of keys and values in a value, itself included."""
    if isinstance(value, dict):
        return 1 + sum(1 + _count_values(part) for part in cast("dict[Any, Any]", value).values())
    return 1 + sum(_count_values(part) for part in cast("list[Any]", value)) if isinstance(value, list) else 1
