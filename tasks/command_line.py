"""The command `trocar score`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hub.command_line.display import show_tables
from hub.command_line.options import Json, RecordingPath, Trust

if TYPE_CHECKING:
    from schemas.trocar_msgs import TaskEvent
    from tasks.recorded.streams import Scored

__all__ = ["app"]

app = typer.Typer()


@app.command()
def score(
    recording: RecordingPath,
    *,
    rules: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Score by these rules; default: all. May be repeated."),
    ] = None,
    trust: Trust = False,
    everything: Annotated[
        bool, typer.Option("--all", help="Also show scores without a value, with the reasons.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Score a recorded session, or a ROS bag of a real arm: metrics, events, and the rules of others."""
    from hub.recording.scores import score_numbers, score_tables

    found = _score_file(recording, rules or [], trust=trust)
    scores = {name: score_numbers(one.card) for name, one in found.items()}
    if as_json:
        events = {name: [_numbers(event) for event in one.events] for name, one in found.items()}
        typer.echo(json.dumps({"scores": scores, "events": events}, indent=2))
        return
    for name, one in found.items():
        show_tables(score_tables(name, scores[name], everything=everything))
        if one.events:
            rows = [[_text(cell) for cell in _numbers(event).values()] for event in one.events]
            show_tables([((f"{name}, at (s)", "event", "object", "arm", "place", "value", "unit"), rows)])


def _score_file(path: Path, rules: list[str], *, trust: bool) -> dict[str, Scored]:
    from hub.recording.bag_files import bag_file
    from hub.recording.recording import Recording
    from schemas.errors import RecordingError
    from tasks.recorded.ros_bag import score_ros_bag
    from tasks.recorded.session import score_session

    try:
        is_mcap = bag_file(path).suffix == ".mcap"
    except RecordingError:  # a bag of other files, or of several
        is_mcap = False
    if is_mcap and "plan.json" in (recording := Recording(path)).attachments:
        return score_session(recording, rules, trust=trust)
    return {"practice": score_ros_bag(path, rules)}


def _numbers(event: TaskEvent) -> dict[str, Any]:
    return {
        "sim_time_s": event.header.stamp.ns / 1e9,
        "event": event.event,
        "object": event.object,
        "arm": event.arm,
        "place": event.place,
        "value": event.value if event.unit else None,
        "unit": event.unit,
    }


def _text(cell: Any) -> str:
    return "" if cell is None else f"{cell:.6g}" if isinstance(cell, float) else cell
