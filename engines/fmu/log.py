"""The log messages of FMUs, into Python's logging."""

from __future__ import annotations

import logging
from ctypes import byref
from functools import cache
from typing import Any

__all__ = ["fmi2_callbacks", "last_complaint", "log_message", "wants_all"]

_log = logging.getLogger(__name__)
_LEVELS = (logging.DEBUG, logging.WARNING, logging.WARNING, logging.ERROR, logging.CRITICAL, logging.DEBUG)
"""By FMI status: ok, warning, discard, error, fatal, pending (FMI 2 alone)."""
_complaints: dict[str, str] = {}


def log_message(instance: str, status: int, category: bytes | None, message: bytes | None) -> None:
    """Take a message of an FMU instance."""
    text = (message or b"").decode(errors="replace").strip()
    level = _LEVELS[status] if 0 <= status < len(_LEVELS) else logging.ERROR
    if level >= logging.WARNING:
        _complaints[instance] = text
    _log.log(level, "%s: %s: %s", instance, (category or b"").decode(errors="replace"), text)


def last_complaint(instance: str) -> str:
    """Return the last warning or error of an instance, to be put into the error that follows from it, and
    forget it.
    """
    return _complaints.pop(instance, "")


def wants_all() -> bool:
    """Say whether anybody listens to what FMUs log when all is well."""
    return _log.isEnabledFor(logging.DEBUG)


@cache
def fmi2_callbacks() -> Any:
    """Return the callbacks of all FMI 2 instances.

    FMPy's proxy, which formats the variadic messages, holds one logger a process.
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
