"""The surgeon's console of a dVRK: pedals, selection of teleoperations, scale, commands to masters."""

from controllers.dvrk_console.controller import DvrkConsole
from controllers.dvrk_console.params import DvrkConsoleParams

__all__ = ["DvrkConsole", "DvrkConsoleParams"]
