"""A server from start to end: source, link, and the opened browser."""

from __future__ import annotations

import signal
import webbrowser
from contextlib import ExitStack
from importlib.resources import files
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from hub.command_line.display import console as terminal
from hub.hosting.end_with_parent import end_with_parent
from hub.hosting.interrupt import Interrupt
from webconsole.afterlife import Afterlife
from webconsole.console import Console
from webconsole.gate import Role
from webconsole.hosted import HostedDevices
from webconsole.library import Library, home_of
from webconsole.listening import Listening, fingerprint, on_loopback, with_tls
from webconsole.live import Live
from webconsole.open_recording import open_recording
from webconsole.pilot import Pilots
from webconsole.server import Server

__all__ = ["serve"]

if TYPE_CHECKING:
    from webconsole.foxglove.face import Face

_FOXGLOVE = "/foxglove"
"""Path of Foxglove's WebSocket."""


def serve(
    recording: Path | None,
    *,
    trust: bool = False,
    endpoint: str | None = None,
    session: str | None = None,
    port: int | None = None,
    listen: str | None = None,
    certificates: Path | None = None,
    browse: bool = True,
    at: float | None = None,
    foxglove: bool = False,
    role: Role = "operator",
    one_session: bool = False,
    parent: int | None = None,
) -> None:
    """Serve the page of a recording, or of a running session, until Ctrl-C, SIGTERM or the terminal's end.

    Args:
        recording: The recording; None: a running session.
        trust: Draw the recorded scene of changed files, too.
        endpoint: Endpoint of the hub; None: any hub of this user on this machine.
        session: Name of the session; None: the first session found.
        port: Port on loopback; None: any free port.
        listen: Where to listen to further machines, such as tls/0.0.0.0:8470; None: on loopback alone.
        certificates: The hub's certificate for `listen`, or the directory; None: the directory of this user.
        browse: Open the page in a browser.
        at: Instant of the recording to begin at, s; None: its start.
        foxglove: Let Foxglove look too, by a separate link.
        role: Role of the holder of the printed link.
        one_session: Show the first session only, then its recording until the last page has gone.
        parent: The process of the hub; this process ends with the hub.

    Raises RecordingError if there is no such recording, ConnectError if no port is free or a certificate is
    missing, ScenarioError if `listen` is no endpoint of TLS.
    """
    if parent is not None:
        end_with_parent(parent)
    with ExitStack() as stack:
        stack.enter_context(Interrupt())  # uvicorn raises SIGTERM again once it has shut down
        if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
            signal.signal(signal.SIGHUP, _terminate)
        listening = on_loopback(port) if listen is None else with_tls(listen, certificates)
        stack.enter_context(listening.socket)
        if recording is None:
            source = Live(endpoint, session, parent)
        else:
            source = open_recording(recording, stack, trust=trust)
        console = Console(source, Pilots())
        afterlife = Afterlife(console, stack) if one_session else None
        library = Library(home_of(recording), console, stack)
        _serve(console, listening, library, role, afterlife, browse=browse, at=at, foxglove=foxglove)


def _terminate(_number: int, _frame: FrameType | None) -> None:
    signal.raise_signal(signal.SIGTERM)


def _serve(
    console: Console,
    listening: Listening,
    library: Library,
    role: Role,
    afterlife: Afterlife | None,
    *,
    browse: bool,
    at: float | None,
    foxglove: bool,
) -> None:
    source = console.source
    face = _foxglove_door(console) if foxglove else None
    others = {} if face is None else {_FOXGLOVE: face.relay}
    server = Server(console, listening, others, afterlife, library)
    link = f"{listening.origins[0]}{server.gate.invite(role)}" + (f"#t={at:.3f}" if at is not None else "")
    hosted = HostedDevices(console.pilots)
    if isinstance(source, Live):

        def join() -> None:
            if source.plan is not None:
                hosted.join(source.endpoint, source.plan)

        console.drawable = join
        source.start()

    def announce_link() -> None:
        _print_line(f"the page is at {link}")
        if listening.certificate is not None:
            authority = listening.certificate.with_name("ca.pem")
            _print_line(
                f"a browser warns unless it knows {authority}; go on only if it shows this SHA-256:"
                f" {fingerprint(listening.certificate)}"
            )
        if face is not None:
            address = f"{listening.origins[0].replace('http', 'ws', 1)}{server.gate.link(_FOXGLOVE)}"
            _print_line(f"Foxglove: open a connection to {address}")
            _print_line(f"and import the layout {files('webconsole.foxglove') / 'layout.json'}")
        if browse:
            webbrowser.open(link)

    try:
        server.run(announce_link)
    finally:
        hosted.close()
        if face is not None:
            face.close()


def _foxglove_door(console: Console) -> Face:
    """Return the door to Foxglove, imported here: without Foxglove the packages may be missing."""
    from webconsole.foxglove.face import Face

    return Face(console)


def _print_line(text: str) -> None:
    terminal.print(text, markup=False, highlight=False, soft_wrap=True)
