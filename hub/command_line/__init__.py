"""The `trocar` command."""

import os

from hub.hosting.numerics import pin_numerics

pin_numerics(os.environ)  # before anything imports numpy: participants may run in this process

from hub.command_line.app import main  # noqa: E402

__all__ = ["main"]
