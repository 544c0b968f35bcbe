"""What arrives on readers of Cyclone DDS, taken in a thread of our own."""

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

__all__ = ["Arrivals"]

log = logging.getLogger(__name__)

_AT_ONCE = 64
_LONGEST_WAIT_NS = duration(hours=1)


class Arrivals(WaitSet):
    """Waits for readers and hands on what they have, those added first before others.

    Not a listener: that is called in the thread which receives for all, and there it would wait for Python's
    interpreter, which a simulation in the same process holds for milliseconds.
    """

    def __init__(self, participant: DomainParticipant, name: str) -> None:
        """Take the participant whose readers they are, and the thread's name, and begin."""
        super().__init__(participant)
        self._taken: list[Callable[[], None]] = []
        self._ended = GuardCondition(participant)
        self._waitset_attach(self._ref, self._ended._ref, -1)
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def add(self, reader: DataReader[Any] | BuiltinDataReader, take: Callable[[Any], None]) -> None:
        """Call `take` with every sample of a reader, from now on; it must not raise."""
        reader.set_status_mask(DDSStatus.DataAvailable)

        def all_there() -> None:
            samples = reader.take(_AT_ONCE)
            while samples:
                for sample in samples:
                    take(sample)
                samples = reader.take(_AT_ONCE)

        self._taken.append(all_there)
        self._waitset_attach(self._ref, reader._ref, len(self._taken) - 1)

    def _run(self) -> None:
        while True:
            triggered = (ctypes.c_ssize_t * (len(self._taken) + 1))()
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
                    self._taken[number]()
                except DDSException as error:
                    log.warning("a reader of DDS fails: %s", error)
                except (
                    Exception
                ):  # one sample that goes wrong in a way nobody thought of is not to end all hearing
                    log.exception("a sample on DDS cannot be taken")

    def close(self) -> None:
        """Take nothing more."""
        self._ended.set(True)
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=2.0)
