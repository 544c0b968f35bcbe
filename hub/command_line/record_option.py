"""The options `--record` and `--overwrite`: where a session's recording goes."""

from __future__ import annotations

import shutil
from datetime import datetime
from itertools import chain, count
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

__all__ = ["Overwrite", "RecordTo", "RecordingCommand", "delete_earlier", "recording_directory"]

_OPTION = "--record"
_UNNAMED = "."
"""Value of `--record` without a directory: `.` exists, so it cannot be a new one."""

RecordTo = Annotated[
    Path | None,
    typer.Option(
        _OPTION,
        metavar="[DIR]",
        help="Record to a new directory, a rosbag2 bag; without DIR: recordings/NAME-DATE-TIME.",
    ),
]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Delete the recording in the directory of `--record` first.")
]


class RecordingCommand(TyperCommand):
    """A command with the option `--record`, whose value may be left out."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the arguments; `--record` at the end or before another option stands for an unnamed one."""
        for at in [at for at, arg in enumerate(args) if arg == _OPTION]:
            if at + 1 == len(args) or args[at + 1].startswith("-"):
                args[at] = f"{_OPTION}={_UNNAMED}"
        return super().parse_args(ctx, args)


def recording_directory(given: Path | None, name: str, *, overwrite: bool) -> Path | None:
    """Return the directory to record to; None: no recording is asked for.

    Args:
        given: value of `--record`.
        name: name of the scenario, for a recording without a name.
        overwrite: whether the directory may hold an earlier recording, for `delete_earlier`.

    Raises typer.BadParameter for a directory that holds something else, and for nothing to overwrite.
    """
    if given is None:
        if overwrite:
            raise typer.BadParameter(
                "--overwrite says what to do with the directory of --record: add that too"
            )
        return None
    if str(given) == _UNNAMED:
        return _dated_directory(name)
    if not given.exists() or (given.is_dir() and not any(given.iterdir())):
        return given
    if not overwrite:
        raise typer.BadParameter(
            f"'{given}' exists already; name a new directory, leave the name out, or add --overwrite"
        )
    if not given.is_dir() or given.is_symlink() or not _holds_a_recording_only(given):
        raise typer.BadParameter(f"'{given}' holds something else than a recording; delete it yourself")
    return given


def delete_earlier(directory: Path | None) -> None:
    """Delete the earlier recording in a `recording_directory`, just before the session records there."""
    if directory is not None and directory.exists():
        shutil.rmtree(directory)


def _dated_directory(name: str) -> Path:
    """Return a new directory named after scenario, date and time, and a number from the second on."""
    first = Path("recordings") / f"{name}-{datetime.now().astimezone():%Y%m%d-%H%M%S}"
    later = (first.with_name(f"{first.name}-{number}") for number in count(2))
    return next(path for path in chain([first], later) if not path.exists())


def _holds_a_recording_only(directory: Path) -> bool:
    """Return whether every entry is a file of a rosbag2 bag, and one of them is its MCAP file."""
    entries = list(directory.iterdir())
    return any(entry.suffix == ".mcap" for entry in entries) and all(
        entry.is_file() and (entry.suffix == ".mcap" or entry.name == "metadata.yaml") for entry in entries
    )
