"""`trocar list` and `trocar new`: the installed scenarios, and a scenario of your own."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.text import Text

from hub.command_line.display import results, show_commands
from hub.command_line.last_runs import last_wall_times
from hub.planning import registry
from hub.planning.scenario_file import ScenarioFile, installed_scenarios, load, scenario_families
from hub.planning.scenario_source import Source, read
from hub.recording.file_hashes import file_hashes
from schemas.errors import ScenarioError
from schemas.keys import valid_session_name

__all__ = ["list_scenarios", "new", "print_scenarios"]

_SCHEMA = "scenario.schema.json"
_LONG, _HERE = 13, 8
"""Width of the column with times, and its growth where wall times are known."""
_LEADS = 17
"""Width of the column with the kinds that lead, so that 80 columns have room for what happens."""


def list_scenarios() -> None:
    """List the installed scenarios by family: what happens, what leads it, how long it takes.

    A scenario that you have run on this machine has the wall time of its last run in brackets.
    """
    print_scenarios()


def print_scenarios() -> None:
    """Print the installed scenarios by family, and what to do with one."""
    installed = installed_scenarios()
    width = max(map(len, installed)) + 1
    here = last_wall_times()
    long_width = _LONG + (_HERE if here else 0)
    for family, names in scenario_families().items():
        results.print(f"[bold]{escape(family)}[/]")
        for name in names:
            what, leads, long = _columns(read(installed[name]))
            taken = f" ({here[name]:.0f} s)" if name in here else ""
            start = f"  {name:{width}}{long + taken:{long_width}}"
            if not results.is_terminal:  # a file has any width
                results.print(Text(f"{start}{leads:29}{what}"), soft_wrap=True)
                continue
            leads = leads if len(leads) < _LEADS else f"{leads[: _LEADS - 2]}…"
            results.print(Text(f"{start}{leads:{_LEADS}}{what}"), no_wrap=True, overflow="ellipsis")
        results.print()
    also = "; in brackets: wall time of your last run on this machine" if here else ""
    results.print(f"Times are simulated{also}.", soft_wrap=True)
    results.print()
    show_commands(
        [
            ("trocar run NAME --open", "run one, and watch it in the browser"),
            ("trocar check NAME", "the participants; --ports: all connections"),
            ("trocar new MINE --from NAME", "a copy of your own, with its data"),
        ]
    )


def _columns(source: Source) -> tuple[str, str, str]:
    """Return what happens, what leads it, and the simulated time."""
    tree = source.tree
    what = re.split("[:;.]", " ".join(tree["description"].split()))[0]
    return what, ", ".join(_leads(tree)), tree.get("duration", "until Ctrl-C")


def _leads(tree: dict[str, dict[str, dict[str, str]]]) -> list[str]:
    """Return the kinds that lead a session: its devices, else the first participant, if a controller."""
    kinds = [spec["kind"] for spec in tree["participants"].values()]
    roles = [registry.kinds()[kind].role for kind in kinds]
    devices = [kind for kind, role in zip(kinds, roles, strict=True) if role == "device"]
    return devices or kinds[: roles[0] == "controller"]


def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of your scenario, and of its directory.")],
    *,
    origin: Annotated[
        str,
        typer.Option(
            "--from",
            metavar="SCENARIO",
            help="The installed scenario or YAML file to start from.",
            autocompletion=lambda: list(installed_scenarios()),
        ),
    ] = "palpation",
) -> None:
    """Copy a scenario with its data to a directory of your own, to edit."""
    directory = Path(name)
    if not valid_session_name(directory.name):
        raise typer.BadParameter(f"'{name}' is no name: a letter, then letters, digits, hyphens, underscores")
    if directory.exists():
        raise typer.BadParameter(f"'{directory}' exists already; choose another name")
    file = load(origin)
    written = _copy(file, directory)
    results.print(f"wrote {escape(str(written))}, a copy of {escape(origin)}", soft_wrap=True)
    results.print()
    show_commands(
        [
            (f"trocar check {written}", "after editing: what is wrong, with line and column"),
            (f"trocar run {written} --open", "run it, and watch it in the browser"),
        ]
    )


def _copy(file: ScenarioFile, directory: Path) -> Path:
    """Copy a scenario, the files beside it that it reads, and the schema; return the new scenario file.

    Raises ScenarioError if the scenario has no name in a line of its own.
    """
    source = file.source
    text, found = re.subn(r"(?m)^name:.*$", f"name: {directory.name}", source.text, count=1)
    if not found:
        raise ScenarioError(f"{source.file} has no line 'name: ...'; copy the file yourself")
    home = source.directory
    directory.mkdir(parents=True)
    for path in map(Path, file_hashes(file.params.values(), home)):
        if path.is_relative_to(home):  # other files are named by a full path, which stays right
            copy = directory / path.relative_to(home)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, copy)
    schema = home / _SCHEMA
    if schema.is_file():
        shutil.copyfile(schema, directory / _SCHEMA)
    written = directory / f"{directory.name}.yaml"
    written.write_text(text, encoding="utf-8")
    return written
