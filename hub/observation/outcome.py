"""The sentence about the result of a run, and whether the run succeeded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from schemas.readable import counted, readable
from schemas.scenario import Outcome, Scenario

__all__ = ["Verdict", "verdict"]


class Verdict(NamedTuple):
    """The result of a run."""

    text: str
    """What was done; empty: neither scenario nor task says."""
    succeeded: bool | None
    """None: neither scenario nor task has conditions."""


def verdict(
    scenario: Scenario, measures: Mapping[str, float | None], scores: Mapping[str, Mapping[str, Any]]
) -> Verdict:
    """Return the verdict by the scenario's outcome, else by the score cards of its tasks.

    Args:
        scenario: the scenario.
        measures: results by name, in the units of `scenario.measure`.
        scores: `hub.recording.scores.score_numbers` by participant.
    """
    if scenario.outcome is not None:
        return _of_scenario(scenario.outcome, scenario, measures)
    cards = [card for card in scores.values() if card["goals"]]
    if not cards:
        return Verdict("", None)
    return Verdict("; ".join(map(_goals_reached, cards)), all(c["reached"] == c["goals"] for c in cards))


def _of_scenario(outcome: Outcome, scenario: Scenario, measures: Mapping[str, float | None]) -> Verdict:
    text = ""
    for literal, name in outcome.parts:
        value = None if name is None else measures[name]
        text += literal
        if name is not None:
            text += "an unknown value" if value is None else readable(value, scenario.measure[name].si_unit)
    if not outcome.success:
        return Verdict(text, None)
    results = {name: measures[name] for name in outcome.success}
    return Verdict(
        text,
        all(value is not None and outcome.success[name].allow(value) for name, value in results.items()),
    )


def _goals_reached(card: Mapping[str, Any]) -> str:
    """Return the sentence of a score card (`score_numbers`)."""
    reached, goals = card["reached"], card["goals"]
    time = card["metrics"].get("completion_time", {}).get("value")
    within = f" in {readable(time, 's')}" if time is not None and reached == goals else ""
    return f"{reached} of {counted(goals, 'goal')} reached{within}"
