"""The application: all commands, and the common version, logs, errors and exit codes."""

from __future__ import annotations

import logging
import sys
from importlib.metadata import version
from typing import Annotated

import typer
from rich.logging import RichHandler
from rich.text import Text

from hub.command_line import certs, plugins, recordings
from hub.command_line.check import check, schema
from hub.command_line.display import console
from hub.command_line.doctor import doctor
from hub.command_line.forks import fork, forks
from hub.command_line.hosts import device, engine
from hub.command_line.link import link
from hub.command_line.ls import ls
from hub.command_line.record_option import RecordingCommand
from hub.command_line.run import run
from hub.command_line.scenarios import list_scenarios, new
from hub.planning.limits import safe_text
from schemas.errors import ScenarioError, TrocarError

__all__ = ["app", "main"]

log = logging.getLogger("trocar")

_LONGEST = 100_000
"""Characters of an error message."""

app = typer.Typer(
    name="trocar",
    help="Co-simulation hub for robotic surgery research.",
    epilog=(
        "Exit codes: 0 done; 1 the session failed; 2 bad usage or a bad scenario. Results go to stdout,"
        " progress and logs to stderr."
    ),
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.command(cls=RecordingCommand)(run)
app.command("list")(list_scenarios)
app.command()(new)
app.command(cls=RecordingCommand)(fork)
for command in (
    check,
    recordings.verify,
    recordings.replay,
    recordings.recover,
    forks,
    recordings.report,
    ls,
    link,
    engine,
    device,
    doctor,
    schema,
):
    app.command()(command)
app.add_typer(certs.app, name="certs")
plugins.mount_plugins(app)


def _print_version(given: bool) -> None:
    if given:
        typer.echo(version("trocar"))
        raise typer.Exit


_WELCOME = """\
Trocar: co-simulation for robotic surgery. Three things to try:

  trocar list                   all scenarios, by family
  trocar run palpation --open   a robot presses soft tissue; watch it in the browser
  trocar doctor                 what this machine can do

trocar --help shows all commands."""


@app.callback()
def options(
    context: typer.Context,
    *,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show debug logs and the traceback of an error.")
    ] = False,
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Co-simulation hub for robotic surgery research."""
    level = logging.DEBUG if debug else logging.INFO
    if console.is_terminal:
        handler, layout = RichHandler(console=console, show_path=debug), "%(message)s"
    else:  # one line for each message, whatever its length
        handler, layout = logging.StreamHandler(), "%(asctime)s %(levelname)s %(message)s"
    handler.setFormatter(_Printable(layout))
    logging.basicConfig(level=level, handlers=[handler])
    # where MUJOCO_GL is set, the import of MuJoCo reports that an optional package is not there
    logging.getLogger("OpenGL.acceleratesupport").setLevel(logging.WARNING)
    if context.invoked_subcommand is None:
        typer.echo(_WELCOME)


class _Printable(logging.Formatter):
    """A message may quote a stranger's file: nothing in it is a command to the terminal."""

    def format(self, record: logging.LogRecord) -> str:
        return safe_text(super().format(record), _LONGEST)


def main() -> None:
    """Run the command line: a TrocarError becomes a message and an exit code."""
    try:
        app()
    except TrocarError as error:
        log.debug("traceback", exc_info=error)  # shown with --debug
        message = safe_text(str(error), _LONGEST)  # it may quote a stranger's file
        console.print(Text("error: ", "bold red"), Text(message), sep="", soft_wrap=True)
        sys.exit(2 if isinstance(error, ScenarioError) else 1)
