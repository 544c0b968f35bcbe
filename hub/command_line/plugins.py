"""Commands that other packages bring: a `typer.Typer` under an entry point of the group `trocar.commands` is
mounted under its name.

One that has a single command is that command, as it would be by itself; any other is a group.
"""

from __future__ import annotations

import logging
from importlib.metadata import entry_points

import typer
import typer.main
from typer.core import TyperGroup

__all__ = ["GROUP", "mount"]

log = logging.getLogger(__name__)

GROUP = "trocar.commands"
"""Entry-point group.

Whatever is mounted is imported for every command, so it imports what it needs inside its own ones.
"""


def mount(app: typer.Typer) -> None:
    """Add every installed sub-command to `app`; one that cannot be had is left out with a warning, so that
    the others work.
    """
    taken = {
        (info.name or getattr(info.callback, "__name__", "")).replace("_", "-")
        for info in app.registered_commands
    }
    for entry in sorted(entry_points(group=GROUP), key=lambda e: (e.name, e.value)):
        brought = (
            f"command '{entry.name}' of '{entry.dist.name if entry.dist else 'an unnamed distribution'}'"
            f" ({entry.value})"
        )
        if entry.name in taken:
            log.warning("%s is left out: there is another command of that name", brought)
            continue
        try:
            loaded = entry.load()
            if not isinstance(loaded, typer.Typer):
                raise TypeError(f"expected a typer.Typer, got {type(loaded).__name__}")
            command = typer.main.get_command(loaded)  # what is wrong with its commands shows here
        except Exception as error:  # noqa: BLE001  # whatever a plug-in's module does on import
            log.warning("%s is left out, it cannot be loaded: %s: %s", brought, type(error).__name__, error)
            continue
        taken.add(entry.name)
        if isinstance(command, TyperGroup):
            app.add_typer(loaded, name=entry.name)
        else:
            (only,) = loaded.registered_commands
            only.name = entry.name
            app.registered_commands.append(only)
