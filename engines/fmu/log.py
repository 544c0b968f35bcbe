"""The log messages of FMUs, into Python's logging."""

from __future__ import annotations

import logging
from ctypes import byref
from functools import cache
from typing import Any

__all__ = ["fmi2_callbacks", "last_warning", "log_everything", "log_message"]

_log = logging.getLogger(__name__)
_LEVELS = (logging.DEBUG, logging.WARNING, logging.WARNING, logging.ERROR, logging.CRITICAL, logging.DEBUG)
"""Log levels by FMI status: ok, warning, discard, error, fatal, pending (FMI 2 alone)."""
_last_warnings: dict[str, str] = {}


def log_message(instance: str, status: int, category: bytes | None, message: bytes | None) -> None:
    """Log a message of an FMU instance."""
    text = (message or b"").decode(errors="replace").strip()
    level = _LEVELS[status] if 0 <= status < len(_LEVELS) else logging.ERROR
    if level >= logging.WARNING:
        _last_warnings[instance] = text
    _log.log(level, "%s: %s: %s", instance, (category or b"").decode(errors="replace"), text)


def last_warning(instance: str) -> str:
    """Return the last warning or error of an instance once, as part of the following error."""
    return _last_warnings.pop(instance, "")


def log_everything() -> bool:
    """Return whether FMUs shall log more than warnings and errors."""
    return _log.isEnabledFor(logging.DEBUG)


@cache
def fmi2_callbacks() -> Any:
    """Return the callbacks of all FMI 2 instances.

    FMPy's proxy for the variadic messages holds a single logger per process.
    """
    from fmpy import calloc, fmi2, free

    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(_fmi2_log)
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
    try:
        from fmpy.logging import addLoggerProxy
    except OSError as error:  # FMPy brings its proxy for x86_64 alone
        _log.info("log messages of FMI 2 FMUs stay unformatted: %s", error)
    else:
        addLoggerProxy(byref(callbacks))
    return callbacks


def _fmi2_log(
    environment: int | None,  # noqa: ARG001
    instance: bytes | None,
    status: int,
    category: bytes | None,
    message: bytes | None,
) -> None:
    log_message((instance or b"").decode(errors="replace"), status, category, message)
