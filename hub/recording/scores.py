"""The numbers of a score card: for the summary, for tables and for reports."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from schemas.readable import readable
from schemas.trocar_msgs import ScoreCard, ScoreValue

__all__ = ["score_numbers", "score_tables"]

_Table = tuple[tuple[str, ...], list[tuple[str, ...]]]
"""The heads of the columns, and the rows."""


def score_numbers(card: ScoreCard) -> dict[str, Any]:
    """Return the numbers of a score card, for a summary.

    `metrics` has by name `value`, `unit` and, where there is no value, None and the `reason`; `rules` has the
    same for each set of rules.
    """
    return {
        "task": card.task,
        "sim_time_s": card.header.stamp.ns / 1e9,
        "goals": card.goals,
        "reached": card.reached,
        "metrics": _by_name(card.metrics),
        "rules": {rule.rules: _by_name(rule.values) for rule in card.rules},
    }


def _by_name(values: Iterable[ScoreValue]) -> dict[str, dict[str, Any]]:
    return {
        one.name: {"value": None, "unit": one.unit, "reason": one.reason}
        if one.reason
        else {"value": one.value, "unit": one.unit}
        for one in values
    }


def score_tables(name: str, numbers: Mapping[str, Any], *, everything: bool = True) -> Iterator[_Table]:
    """Yield the result of `score_numbers` as tables: metrics of the task `name`, scores by rules.

    `everything`: also yield the missing values with their reasons.
    """
    groups = {"": numbers["metrics"], **numbers["rules"]}
    without: dict[str, list[str]] = {}
    for group, values in groups.items():
        is_first = numbers["goals"] and not group
        rows = [("goals reached", f"{numbers['reached']} of {numbers['goals']}")] if is_first else []
        for metric, one in values.items():
            label = metric.replace("_", " ")
            if one["value"] is None:
                without.setdefault(one["reason"], []).append(f"{group} {label}".lstrip())
            else:
                rows.append((label, readable(one["value"], one["unit"])))
        if rows:
            yield (f"{name}, by {group}" if group else f"{name} ({numbers['task']})", "value"), rows
    if without and everything:
        yield (
            ("no value, because", "of"),
            [(reason, ", ".join(names)) for reason, names in without.items()],
        )
