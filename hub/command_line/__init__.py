"""The `trocar` command."""

import os

from hub.hosting.blas import pin_blas

pin_blas(os.environ)  # before anything imports numpy: participants may run in this process

from hub.command_line.app import main  # noqa: E402

__all__ = ["main"]
