"""Interrupts the main thread in any wait or computation."""

from __future__ import annotations

import inspect
import signal
import threading
from _thread import interrupt_main
from traceback import walk_stack
from types import FrameType, TracebackType
from typing import Any, Self

__all__ = ["Interrupt"]

_IMPORT_SYSTEM = "<frozen importlib._bootstrap>"
_RETRY_S = 0.05
"""Time until an interrupt that came during an import is tried again."""


class Interrupt:
    """Within this context, SIGTERM raises KeyboardInterrupt in the main thread, and so does a call.

    Calls from any thread are allowed; they send SIGTERM, as programs started by a shell in the background
    ignore SIGINT. Ctrl-C raises as ever, and is noted. Outside the main thread the context does nothing.

    Neither raises during an import, but after it: an exception that reaches the initialisation of a module in
    C++ ends the process at once (seen with manifold3d), and nothing is closed.
    """

    def __init__(self) -> None:
        self._armed = self._raised = False
        self._sending = threading.Lock()
        self._before: dict[signal.Signals, Any] = {}
        self._imports = 0
        """Imports in progress where the context was entered."""

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._imports = _imports_in_progress(inspect.currentframe())
            self._before[signal.SIGTERM] = signal.signal(signal.SIGTERM, self._raise)
            if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
                self._before[signal.SIGINT] = signal.signal(signal.SIGINT, self._raise)
            self._armed = True
        return self

    @property
    def raised(self) -> bool:
        """Whether an interrupt has been raised since the context was entered, and before `disarm`."""
        return self._raised

    def disarm(self) -> None:
        """Raise nothing any more: the main thread closes all open resources.

        No signal of another thread is pending afterwards.
        """
        with self._sending:
            self._armed = self._raised = False

    def __call__(self) -> None:
        """Interrupt the main thread, also out of a sleeping call."""
        with self._sending:
            if not self._armed:
                return
            if hasattr(signal, "pthread_kill"):
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)
            else:
                interrupt_main(signal.SIGTERM)

    def _raise(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal, between two instructions of the main thread; after `disarm` only Ctrl-C."""
        if self._armed and _imports_in_progress(frame) > self._imports:
            retry = threading.Timer(_RETRY_S, self)
            retry.daemon = True
            retry.start()
        elif self._armed:
            self._armed, self._raised = False, True
            raise KeyboardInterrupt
        elif number == signal.SIGINT:
            raise KeyboardInterrupt

    def check(self) -> None:
        """Raise a lost interrupt again: Zenoh swallows an interrupt in a callback in the main thread."""
        if self._raised:
            raise KeyboardInterrupt

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._before:
            self.disarm()
        for number, handler in self._before.items():
            signal.signal(number, handler)


def _imports_in_progress(frame: FrameType | None) -> int:
    """Return a number that is larger within an import than around it."""
    return sum(one.f_code.co_filename == _IMPORT_SYSTEM for one, _ in walk_stack(frame))
