"""The `trocar` command."""

from hub.command_line.app import main

__all__ = ["main"]
