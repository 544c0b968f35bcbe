"""Interrupts the main thread in whatever it waits for or computes."""

from __future__ import annotations

import signal
import threading
from _thread import interrupt_main
from types import FrameType, TracebackType
from typing import Any, Self

__all__ = ["Interrupt"]


class Interrupt:
    """While it is entered, SIGTERM raises KeyboardInterrupt in the main thread, and so does calling it.

    It may be called from any thread. SIGINT would not work: a shell lets the programs that it starts in the
    background ignore it. Entered in another thread than the main one, it does nothing.
    """

    def __init__(self) -> None:
        self._armed = self._raised = False
        self._sending = threading.Lock()
        self._before: Any = None

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGTERM, self._raise)
            self._armed = True
        return self

    def disarm(self) -> None:
        """Raise nothing any more: the main thread closes what it has opened.

        No signal of another thread is pending after that.
        """
        with self._sending:
            self._armed = self._raised = False

    def __call__(self) -> None:
        """Interrupt the main thread, also out of a call that sleeps."""
        with self._sending:
            if not self._armed:
                return
            if hasattr(signal, "pthread_kill"):
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)
            else:
                interrupt_main(signal.SIGTERM)

    def _raise(self, _number: int, _frame: FrameType | None) -> None:
        """Handle SIGTERM, between two instructions of the main thread; after `disarm` it does nothing."""
        if self._armed:
            self._armed, self._raised = False, True
            raise KeyboardInterrupt

    def check(self) -> None:
        """Raise again an interrupt that was lost: Zenoh swallows one in a callback in the main thread."""
        if self._raised:
            raise KeyboardInterrupt

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._before is not None:
            self.disarm()
            signal.signal(signal.SIGTERM, self._before)
