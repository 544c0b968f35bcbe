"""Commands of other packages: each is a `typer.Typer` at an entry point of the group `trocar.commands`.

A Typer with a single command is added as a command, otherwise as a group, under the name of the entry point.
"""

from __future__ import annotations

import logging
from importlib.metadata import entry_points

import typer
import typer.main
from typer.core import TyperGroup

__all__ = ["GROUP", "mount_plugins"]

log = logging.getLogger(__name__)

GROUP = "trocar.commands"
"""Entry-point group.

Modules of the group are imported at every start of `trocar`, so further imports belong inside commands.
"""


def mount_plugins(app: typer.Typer) -> None:
    """Add every installed command to `app`; log a warning about a broken command."""
    taken = {
        (info.name or getattr(info.callback, "__name__", "")).replace("_", "-")
        for info in app.registered_commands
    }
    for entry in sorted(entry_points(group=GROUP), key=lambda e: (e.name, e.value)):
        origin = (
            f"command '{entry.name}' of '{entry.dist.name if entry.dist else 'an unnamed distribution'}'"
            f" ({entry.value})"
        )
        if entry.name in taken:
            log.warning("%s is left out: another command has that name", origin)
            continue
        try:
            loaded = entry.load()
            if not isinstance(loaded, typer.Typer):
                raise TypeError(f"expected a typer.Typer, got {type(loaded).__name__}")
            command = typer.main.get_command(loaded)  # raises if one of its commands is invalid
        except Exception as error:  # noqa: BLE001  # a plug-in's module may raise anything on import
            log.warning("%s is left out, it cannot be loaded: %s: %s", origin, type(error).__name__, error)
            continue
        taken.add(entry.name)
        if isinstance(command, TyperGroup):
            app.add_typer(loaded, name=entry.name)
        else:
            (only,) = loaded.registered_commands
            only.name = entry.name
            app.registered_commands.append(only)
