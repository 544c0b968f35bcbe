"""Reliable transfer between one writer and one reader of DDS, over datagrams: OMG DDSI-RTPS 2.5, 8.4."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence

from devices.ros.dds.rtps import Acknack, Data, Gap, Heartbeat, acknack, data, heartbeat

__all__ = ["Post", "Receiving", "Sending"]

Post = Callable[[Sequence[bytes]], None]
"""Sends submessages to the other side."""

_KEPT = 64
"""Samples of one line that are kept for who did not get them, and that wait for earlier ones."""


class Sending:
    """From a writer of ours to one reader, which has numbers of its own: no other reader's samples are gaps
    to it.
    """

    def __init__(self, post: Post, writer: bytes, reader: bytes) -> None:
        """Take what sends, and the ids (4 bytes) of both."""
        self._post, self._writer, self._reader = post, writer, reader
        self._kept: deque[tuple[int, bytes, Mapping[int, bytes]]] = deque(maxlen=_KEPT)
        self._last = self._acknowledged = self._beats = 0

    def send(self, payload: bytes, qos: Mapping[int, bytes]) -> None:
        """Send a sample with parameters beside it."""
        self._last += 1
        self._kept.append((self._last, payload, qos))
        self._post([data(self._writer, self._reader, self._last, payload, qos), self._beat()])

    def _beat(self) -> bytes:
        self._beats += 1
        first = self._kept[0][0] if self._kept else self._last + 1
        return heartbeat(self._writer, self._reader, first, self._last, self._beats)

    def repeat(self) -> None:
        """Ask whether all is there, if it is not known."""
        if self._acknowledged < self._last:
            self._post([self._beat()])

    def asked(self, answer: Acknack) -> None:
        """Send again what the reader has not."""
        self._acknowledged = max(self._acknowledged, answer.base - 1)
        missing = set(answer.missing)
        again = [
            data(self._writer, self._reader, number, payload, qos)
            for number, payload, qos in self._kept
            if number in missing
        ]
        if again or not answer.base:  # 0: a reader that does not know yet what there is
            self._post([*again, self._beat()])


class Receiving:
    """From a writer of the other side to a reader of ours, in order."""

    def __init__(self, post: Post, reader: bytes, writer: bytes, take: Callable[[Data], None]) -> None:
        """Take what sends, the ids (4 bytes) of both, and what takes each sample."""
        self._post, self._reader, self._writer, self._take = post, reader, writer, take
        self._expected, self._answers = 1, 0
        self._waiting: dict[int, Data | None] = {}
        """What came before its turn; None: it will never come."""

    def begin(self) -> None:
        """Ask what there is: something may have come before this line was there, and writers tell of
        themselves only every few seconds.
        """
        self._answers += 1
        self._post([acknack(self._writer, self._reader, 0, (), self._answers)])

    def came(self, sample: Data) -> None:
        """Take a sample in its turn."""
        if self._expected <= sample.number < self._expected + _KEPT:
            self._waiting.setdefault(sample.number, sample)
        self._hand_on()

    def beat(self, told: Heartbeat) -> None:
        """Ask for what is missing of what the writer has."""
        self._go_on_from(told.first)
        missing = [
            number
            for number in range(self._expected, min(told.last + 1, self._expected + _KEPT))
            if number not in self._waiting
        ]
        if missing or not told.is_final:
            self._answers += 1
            self._post([acknack(self._writer, self._reader, self._expected, missing, self._answers)])

    def skip(self, gap: Gap) -> None:
        """Wait no longer for what never comes."""
        for number in gap.others:
            if self._expected <= number < self._expected + _KEPT:
                self._waiting.setdefault(number, None)
        if gap.start <= self._expected:
            self._go_on_from(gap.base)
        self._hand_on()

    def _go_on_from(self, first: int) -> None:
        if first > self._expected:
            self._expected = first
            self._waiting = {number: sample for number, sample in self._waiting.items() if number >= first}
        self._hand_on()

    def _hand_on(self) -> None:
        while self._expected in self._waiting:
            sample = self._waiting.pop(self._expected)
            self._expected += 1
            if sample is not None:
                self._take(sample)
