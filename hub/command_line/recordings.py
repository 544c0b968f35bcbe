"""Commands on recordings: `verify`, `replay`, `recover`, `report`."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hub.command_line.display import RunProgress, console, results, show
from hub.command_line.options import Directory, Json, Listen, RecordingPath, Trust
from hub.planning.limits import safe_text
from hub.recording.bag_files import default_output
from hub.recording.recording import Recording

__all__ = ["recover", "replay", "report", "verify"]

Output = Annotated[
    Path | None, typer.Option("--output", "-o", help="Where to write; default: beside the recording.")
]


def verify(
    recording: RecordingPath,
    *,
    trust: Trust = False,
    directory: Directory = None,
    listen: Listen = None,
    as_json: Json = False,
) -> None:
    """Simulate a recorded session again and compare every state hash.

    After a difference the exit code is 1 and the result names the first differing step and participant.
    """
    from hub.verify import verify as resimulate

    opened = Recording(recording)
    with RunProgress(opened.scenario()) as progress:
        summary = resimulate(opened, trust=trust, directory=directory, endpoint=listen, progress=progress)
    show(asdict(summary), as_json=as_json)
    if not summary.same:
        raise typer.Exit(1)


def replay(
    recording: RecordingPath,
    *,
    rate: Annotated[
        float, typer.Option(min=0.0, help="Simulated seconds per second; 0: as fast as possible.")
    ] = 1.0,
    listen: Listen = None,
    as_json: Json = False,
) -> None:
    """Publish the messages of a recording again, as the live session did."""
    from hub.recording.replay import replay as publish
    from hub.transport.loopback_port import LoopbackPort

    port = LoopbackPort(listen)
    with port.listen() as session:
        console.print(f"publishing on {port.endpoint}")
        show(asdict(publish(Recording(recording), session, rate)), as_json=as_json)


def recover(recording: RecordingPath, *, output: Output = None, as_json: Json = False) -> None:
    """Save the readable part of a recording without an end."""
    from hub.recording.recover import recover as save

    show(asdict(save(recording, output)), as_json=as_json)


def report(recording: RecordingPath, *, output: Output = None) -> None:
    """Write a self-contained HTML page with plots of a recording."""
    from hub.recording.report import report as write

    page = output or default_output(recording, ".html")
    write(Recording(recording), page)
    results.print(f"wrote {safe_text(str(page))}", markup=False, soft_wrap=True)
