"""The surgeon's console: pedals, who is selected, scale, and what the masters are told."""

from controllers.console.controller import Console
from controllers.console.params import ConsoleParams

__all__ = ["Console", "ConsoleParams"]
