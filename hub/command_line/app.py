"""The commands put together, and what every one of them has: version, logs, errors, exit codes."""

from __future__ import annotations

import logging
import sys
from importlib.metadata import version
from typing import Annotated

import typer
from rich.logging import RichHandler
from rich.text import Text

from hub.command_line import certs, hosting, linking, looking, plugins, recordings, running
from hub.command_line.display import console
from schemas.errors import ScenarioError, TrocarError

__all__ = ["app", "main"]

log = logging.getLogger("trocar")

app = typer.Typer(
    name="trocar",
    help="Co-simulation hub for robotic surgery research.",
    epilog=(
        "Exit codes: 0 done; 1 the session failed; 2 bad usage or a bad scenario. Results go to stdout,"
        " progress and logs to stderr."
    ),
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

for command in (
    running.run,
    looking.check,
    recordings.verify,
    recordings.replay,
    recordings.recover,
    recordings.report,
    looking.ls,
    linking.link,
    hosting.engine,
    hosting.device,
    looking.doctor,
    looking.schema,
):
    app.command()(command)
app.add_typer(certs.app, name="certs")
plugins.mount(app)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(version("trocar"))
        raise typer.Exit


@app.callback()
def options(
    *,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show debug logs, and the traceback of an error.")
    ] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Co-simulation hub for robotic surgery research."""
    logging.basicConfig(
        level=logging.DEBUG if debug else logging.INFO,
        format="%(message)s",
        handlers=[RichHandler(console=console, show_path=debug)],
    )


def main() -> None:
    """Run the command line: an error that Trocar foresaw is one message and an exit code."""
    try:
        app()
    except TrocarError as error:
        log.debug("traceback", exc_info=error)
        console.print(Text("error: ", "bold red"), Text(str(error)), sep="", soft_wrap=True)
        sys.exit(2 if isinstance(error, ScenarioError) else 1)
