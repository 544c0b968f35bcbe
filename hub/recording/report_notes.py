"""Notes of participants in a report about the validity of their results, by kind."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib.metadata import entry_points
from typing import Any

from schemas.scenario import Scenario

__all__ = ["GROUP", "participant_notes"]

GROUP = "trocar.notes"
"""Entry points by kind: functions with the parameters (a mapping, as in the scenario) as argument. The result
is pairs of a subject and a text.
"""


def participant_notes(scenario: Scenario) -> Iterator[tuple[str, str, str]]:
    """Yield participant, subject and text of the notes of installed kinds."""
    for name, spec in scenario.participants.items():
        for entry in entry_points(group=GROUP, name=spec.kind):
            try:
                notes: Callable[[Mapping[str, Any]], Iterable[tuple[str, str]]] = entry.load()
                rows = list(notes(spec.model_extra or {}))
            except Exception as error:  # noqa: BLE001  # a plug-in may raise anything; the page says what
                rows = [("none", f"{type(error).__name__}: {' '.join(str(error).split())[:300]}")]
            yield from ((name, what, text) for what, text in rows)
