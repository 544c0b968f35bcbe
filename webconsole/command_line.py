"""`trocar view`: the page of a session or a recording."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from hub.command_line.options import Certificates
from schemas.errors import MissingExtraError, ScenarioError

__all__ = ["app"]

app = typer.Typer()


@app.command()
def view(
    recording: Annotated[
        Path | None,
        typer.Argument(
            metavar="[RECORDING]", exists=True, help="A recording; without it, the session that runs."
        ),
    ] = None,
    *,
    connect: Annotated[
        str | None,
        typer.Option(metavar="ENDPOINT", help="Where the hub listens; default: any hub of this machine."),
    ] = None,
    session: Annotated[
        str | None, typer.Option(metavar="NAME", help="The session; default: the first that is found.")
    ] = None,
    port: Annotated[
        int | None, typer.Option(help="Where the page is, on loopback; default: 8470 or the next free one.")
    ] = None,
    listen: Annotated[
        str | None,
        typer.Option(
            metavar="ENDPOINT",
            help="Where other machines reach the page, such as tls/0.0.0.0:8470; default: loopback alone.",
        ),
    ] = None,
    certs: Certificates = None,
    open_: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in a browser.")] = True,
    read_only: Annotated[
        bool, typer.Option("--read-only", help="The link is that of a viewer, who steers and leads nothing.")
    ] = False,
    at: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", min=0.0, help="Begin at this instant of the recording."),
    ] = None,
    trust: Annotated[
        bool, typer.Option("--trust", help="Read files other than those of the recording, to draw its scene.")
    ] = False,
    foxglove: Annotated[
        bool, typer.Option("--foxglove", help="Let Foxglove look at the running session too, read-only.")
    ] = False,
    one_session: Annotated[bool, typer.Option("--one-session", hidden=True)] = False,
    with_parent: Annotated[int | None, typer.Option(hidden=True)] = None,
) -> None:
    """Show a running session or a recording on a page in the browser.

    The printed link works once; from then on the same browser may open the page.
    """
    for package in ("starlette", "uvicorn", "websockets"):
        if find_spec(package) is None:
            raise MissingExtraError("trocar view", "web", package)
    if foxglove and recording is not None:
        raise ScenarioError(
            f"--foxglove is for a running session; Foxglove opens the file of '{recording}' itself"
        )
    if at is not None and recording is None:
        raise ScenarioError("--at is for a recording; a running session is shown as it runs")
    for package in ("foxglove", "cryptography") if foxglove else ():
        if find_spec(package) is None:
            raise MissingExtraError("trocar view --foxglove", "foxglove", package)
    if listen is not None and port is not None:
        raise ScenarioError("--port is on loopback, and the endpoint after --listen has a port of its own")
    from webconsole.serve import serve

    serve(
        recording,
        trust=trust,
        endpoint=connect,
        session=session,
        port=port,
        listen=listen,
        certificates=certs,
        browse=open_,
        at=at,
        foxglove=foxglove,
        role="viewer" if read_only else "operator",
        one_session=one_session,
        parent=with_parent,
    )
