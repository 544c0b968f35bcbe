"""Commands on recordings: `verify`, `replay`, `recover`, `report`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hub.command_line.display import RunProgress, console, show
from hub.command_line.scenarios import Json, Listen
from hub.recording.recording import Recording

__all__ = ["recover", "replay", "report", "verify"]

RecordingPath = Annotated[
    Path,
    typer.Argument(metavar="RECORDING", exists=True, help="A recording's directory, or the MCAP file in it."),
]
Output = Annotated[
    Path | None, typer.Option("--output", "-o", help="Where to write; by default beside the recording.")
]


def verify(recording: RecordingPath, *, listen: Listen = None, as_json: Json = False) -> None:
    """Simulate a recorded session again and compare every state hash; exit code 1 and the first difference if
    one is not the same.
    """
    from hub.verify import verify as resimulate

    opened = Recording(recording)
    with RunProgress(opened.scenario()) as progress:
        summary = resimulate(opened, endpoint=listen, progress=progress)
    show(asdict(summary), as_json=as_json)
    if not summary.same:
        raise typer.Exit(1)


def replay(
    recording: RecordingPath,
    *,
    rate: Annotated[
        float, typer.Option(min=0.0, help="Simulated seconds per second; 0: as fast as it goes.")
    ] = 1.0,
    listen: Listen = None,
    as_json: Json = False,
) -> None:
    """Publish a recording again, so that consoles see it as they would see it live."""
    from hub.recording.replay import replay as publish
    from hub.transport.endpoints import free_endpoint, require_loopback
    from hub.transport.zenoh_session import open_session

    endpoint = require_loopback(listen) if listen else free_endpoint()
    console.print(f"publishing on {endpoint}")
    with open_session("router", listen=[endpoint]) as session:
        show(asdict(publish(Recording(recording), session, rate)), as_json=as_json)


def recover(recording: RecordingPath, *, output: Output = None, as_json: Json = False) -> None:
    """Save what is whole of a recording that was cut short."""
    from hub.recording.recover import recover as save

    show(asdict(save(recording, output)), as_json=as_json)


def report(recording: RecordingPath, *, output: Output = None) -> None:
    """Write one self-contained HTML page of plots about a recording."""
    from hub.recording.report import report as write

    page = output or recording.with_name(f"{recording.stem if recording.is_file() else recording.name}.html")
    write(Recording(recording), page)
    console.print(f"wrote {page}")
