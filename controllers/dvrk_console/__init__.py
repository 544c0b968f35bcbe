"""The surgeon's console: pedals, who is selected, scale, and what the masters are told."""

from controllers.dvrk_console.controller import Console
from controllers.dvrk_console.params import ConsoleParams

__all__ = ["Console", "ConsoleParams"]
