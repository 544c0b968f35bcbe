"""The `trocar` command."""

import os

from hub.hosting.numerics import pin_numerics

__all__ = ["main"]

pin_numerics(os.environ)  # before anything imports numpy: participants may run in this process


def main() -> None:
    """Run the command line."""
    from hub.command_line.app import main as run  # imports plug-ins, which import this package

    run()
