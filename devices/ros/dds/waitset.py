"""Takes samples from readers of Cyclone DDS, in a thread of our own."""

from __future__ import annotations

import ctypes
import logging
import threading
from collections.abc import Callable
from typing import Any

from cyclonedds.builtin import BuiltinDataReader
from cyclonedds.core import DDSException, DDSStatus, GuardCondition, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader
from cyclonedds.util import duration

__all__ = ["ReaderWaitSet"]

log = logging.getLogger(__name__)

_AT_ONCE = 64
_LONGEST_WAIT_NS = duration(hours=1)


class ReaderWaitSet(WaitSet):
    """Waits for readers and passes on their samples, in the order of adding the readers.

    Not a listener: a listener is called in the receiving thread of all readers, and would wait there for
    Python's interpreter, held for milliseconds by a simulation in the same process.
    """

    def __init__(self, participant: DomainParticipant, name: str) -> None:
        """Start the thread `name` for readers of `participant`."""
        super().__init__(participant)
        self._readers: list[Callable[[], None]] = []
        self._ended = GuardCondition(participant)
        self._waitset_attach(self._ref, self._ended._ref, -1)
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def add(self, reader: DataReader[Any] | BuiltinDataReader, on_sample: Callable[[Any], None]) -> None:
        """Call `on_sample` (never raising) with every sample of a reader from now on."""
        reader.set_status_mask(DDSStatus.DataAvailable)

        def take_all() -> None:
            samples = reader.take(_AT_ONCE)
            while samples:
                for sample in samples:
                    on_sample(sample)
                samples = reader.take(_AT_ONCE)

        self._readers.append(take_all)
        self._waitset_attach(self._ref, reader._ref, len(self._readers) - 1)

    def _run(self) -> None:
        while True:
            triggered = (ctypes.c_ssize_t * (len(self._readers) + 1))()
            count = self._waitset_wait(
                self._ref,
                ctypes.cast(triggered, ctypes.POINTER(ctypes.c_void_p)),
                len(triggered),
                _LONGEST_WAIT_NS,
            )
            numbers = sorted(triggered[: min(count, len(triggered))])
            if count < 0 or -1 in numbers:
                return
            for number in numbers:
                try:
                    self._readers[number]()
                except DDSException as error:
                    log.warning("a reader of DDS fails: %s", error)
                # an unforeseen error in one sample must not end the thread
                except Exception:
                    log.exception("a sample on DDS cannot be taken")

    def close(self) -> None:
        """Take no more samples."""
        self._ended.set(True)
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=2.0)
