"""Commands on forks: `trocar fork`, `trocar forks`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from pydantic import TypeAdapter, ValidationError

from hub.command_line.display import RunProgress, results, table
from hub.command_line.options import Certificates, Directory, Json, Overrides, RecordingPath, Trust
from hub.command_line.record_option import Overwrite, RecordTo, delete_earlier, recording_directory
from hub.command_line.run import Everything, Listening, OneHost, require_complete
from hub.command_line.run_summary import show_summary
from hub.recording.family import recording_family
from hub.recording.recording import Recording
from hub.transport.loopback_port import listening_ports
from schemas.quantity import Duration

__all__ = ["fork", "forks"]


def _parse_instant(text: str) -> int:
    try:
        at_ns: int = TypeAdapter[int](Duration).validate_python(text)
    except ValidationError as error:
        raise typer.BadParameter(f"'{text}' is no time: {error.errors()[0]['msg']}") from error
    return at_ns


def _name_of(recording: Path) -> str:
    """Return the name of a recording: of its directory."""
    path = recording.resolve()
    return path.name if path.is_dir() else path.parent.name


def fork(
    recording: RecordingPath,
    *,
    at: Annotated[str, typer.Option(metavar="TIME", help="Simulated time from which on to go on: '12.4 s'.")],
    overrides: Overrides = None,
    record: RecordTo = None,
    overwrite: Overwrite = False,
    pace: Annotated[
        Literal["fast", "realtime"] | None,
        typer.Option(help="Replace the pace of the scenario, from that time on."),
    ] = None,
    trust: Trust = False,
    directory: Directory = None,
    listen: Listening = None,
    certs: Certificates = None,
    one_host: OneHost = False,
    everything: Everything = False,
    as_json: Json = False,
) -> None:
    """Go on from an instant of a recording, live: with other devices, parameters, or a person.

    Up to the instant all is simulated again, with the recorded state hashes. The fork's own recording
    verifies like any recording. The parent may be cut short, or still in writing.
    """
    from hub.fork import Fork

    target = recording_directory(record, f"{_name_of(recording)}-fork", overwrite=overwrite)
    if target is not None and recording.resolve().is_relative_to(target.resolve()):
        raise typer.BadParameter(f"'{target}' is the recording to fork; record to another directory")
    inside, outside = listening_ports(listen or ())
    made = Fork(
        Recording(recording, unfinished=True),
        _parse_instant(at),
        [*(overrides or ()), *([f"pace={pace}"] if pace else ())],
        record=target,
        trust=trust,
        directory=directory,
        one_host=one_host,
        endpoint=inside,
        outside=outside,
        certificates=certs,
    )
    delete_earlier(target)
    with RunProgress(made.session.scenario) as progress:
        summary = made.run(progress)
    show_summary(f"fork of {_name_of(recording)}", summary, everything=everything, as_json=as_json)
    require_complete(summary)


def forks(
    places: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[PLACE]...", exists=True, help="Recordings, or directories that hold some."),
    ] = None,
    *,
    as_json: Json = False,
) -> None:
    """Show recordings as a tree: below each recording its forks, with instant and changes."""
    members = list(recording_family(places or [Path()]))
    if as_json:
        rows: list[dict[str, Any]] = [
            {
                "file": str(one.file),
                "session": one.session,
                "duration_ns": one.duration_ns,
                "origin": None if one.origin is None else one.origin.model_dump(exclude={"renewals"}),
            }
            for one in members
        ]
        typer.echo(json.dumps(rows, indent=2))
        return
    if not members:
        results.print("no recording of a session is here")
        return
    results.print(
        table(
            (
                (
                    f"{'   ' * (one.depth - 1)}{'└─ ' if one.depth else ''}{one.file.parent.name}",
                    one.session,
                    f"{one.duration_ns / 1e9:g} s",
                    "" if one.origin is None else f"{one.origin.time_ns / 1e9:g} s",
                    "" if one.origin is None else ", ".join(one.origin.changes) or "nothing",
                )
                for one in members
            ),
            "recording",
            "session",
            "length",
            "forked at",
            "changed",
        )
    )
