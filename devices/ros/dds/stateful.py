"""Reliable transfer of RTPS: StatefulWriter and StatefulReader (OMG DDSI-RTPS 2.5, 8.4.9 and 8.4.12).

Each is matched with exactly one remote endpoint, and contains the standard's ReaderProxy or WriterProxy.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence

from devices.ros.dds.fragments import PartialSample
from devices.ros.dds.rtps import (
    AckNack,
    Data,
    DataFragments,
    FromWriter,
    Gap,
    Heartbeat,
    HeartbeatFragments,
    encode_acknack,
    encode_data,
    encode_heartbeat,
    encode_nack_fragments,
)
from schemas.errors import MessageError

__all__ = ["SendSubmessages", "StatefulReader", "StatefulWriter"]

SendSubmessages = Callable[[Sequence[bytes]], None]
"""Sends submessages to the participant of the matched endpoint."""

_HISTORY = 64
"""Most samples kept by a writer for retransmission, and by a reader while earlier samples are missing."""
_AT_ONCE = 32
"""Most samples sent again in a datagram."""
_MOST_PARTIAL = 4
"""Most samples of a writer assembled from fragments at a time; further samples are requested again."""


class StatefulWriter:
    """Writes to a single remote reader.

    The writer has sequence numbers of its own: otherwise samples for other readers would be gaps here.
    """

    def __init__(
        self, send: SendSubmessages, writer_id: bytes, reader_id: bytes, *, keeps_all: bool = False
    ) -> None:
        """`writer_id` and `reader_id`: EntityIds, 4 bytes; `keeps_all`: no sample is forgotten."""
        self._send, self._writer_id, self._reader_id = send, writer_id, reader_id
        self._history: deque[tuple[int, bytes, Mapping[int, bytes]]] = deque(
            maxlen=None if keeps_all else _HISTORY
        )
        self._last = self._acknowledged = self._heartbeats = 0

    def write(self, payload: bytes, inline_qos: Mapping[int, bytes]) -> None:
        """Send a sample, with a HEARTBEAT."""
        self._last += 1
        self._history.append((self._last, payload, inline_qos))
        data = encode_data(self._writer_id, self._reader_id, self._last, payload, inline_qos)
        self._send([data, self._next_heartbeat()])

    def _next_heartbeat(self) -> bytes:
        self._heartbeats += 1
        first = self._history[0][0] if self._history else self._last + 1
        return encode_heartbeat(self._writer_id, self._reader_id, first, self._last, self._heartbeats)

    def send_heartbeat(self) -> None:
        """Send a HEARTBEAT, if the reader has not acknowledged all samples."""
        if self._acknowledged < self._last:
            self._send([self._next_heartbeat()])

    def on_acknack(self, acknack: AckNack) -> None:
        """Send the requested samples again."""
        self._acknowledged = max(self._acknowledged, acknack.base - 1)
        missing = set(acknack.missing)
        again = [
            encode_data(self._writer_id, self._reader_id, number, payload, inline_qos)
            for number, payload, inline_qos in self._history
            if number in missing
        ]
        for first in range(0, len(again), _AT_ONCE):
            self._send(again[first : first + _AT_ONCE])
        if again or not acknack.base:  # 0: a reader that has had no HEARTBEAT yet
            self._send([self._next_heartbeat()])


class StatefulReader:
    """Reads from a single remote writer, and delivers the samples in order."""

    def __init__(
        self,
        send: SendSubmessages,
        reader_id: bytes,
        writer_id: bytes,
        deliver: Callable[[Data], None],
    ) -> None:
        """`reader_id` and `writer_id`: EntityIds, 4 bytes."""
        self._send, self.reader_id, self._writer_id, self._deliver = send, reader_id, writer_id, deliver
        self._expected, self._acknacks = 1, 0
        self._early: dict[int, Data | None] = {}
        """Samples arrived before their turn, by sequence number; None: irrelevant by a GAP."""
        self._partial: dict[int, PartialSample] = {}

    def request_heartbeat(self) -> None:
        """Send an ACKNACK of base 0 for a HEARTBEAT of the writer.

        Samples may have been sent before this reader existed, and writers send HEARTBEATs only every few
        seconds.
        """
        self._send_acknack(0, ())

    def _send_acknack(self, base: int, missing: Sequence[int]) -> None:
        self._acknacks += 1
        self._send([encode_acknack(self._writer_id, self.reader_id, base, missing, self._acknacks)])

    def receive(self, part: FromWriter) -> None:
        """Receive a submessage of the writer. Raises MessageError for contradicting fragments."""
        match part:
            case Data():
                self._on_data(part)
            case DataFragments():
                self._on_fragments(part)
            case Heartbeat():
                self._on_heartbeat(part)
            case HeartbeatFragments():
                self._request_fragments(part.sequence_number, part.last)
            case Gap():
                self._on_gap(part)

    def _on_data(self, sample: Data) -> None:
        """Deliver a sample in turn."""
        if self._expected <= sample.sequence_number < self._expected + _HISTORY:
            self._early.setdefault(sample.sequence_number, sample)
        self._deliver_next()

    def _on_fragments(self, part: DataFragments) -> None:
        """Deliver a sample in turn, after the arrival of all fragments."""
        number = part.sequence_number
        if not self._expected <= number < self._expected + _HISTORY or number in self._early:
            return
        if number not in self._partial:
            if len(self._partial) == _MOST_PARTIAL:
                return
            self._partial[number] = PartialSample(part)
        sample = self._partial[number]
        try:
            sample.add(part)
        except MessageError:
            del self._partial[number]  # which of the two is wrong is unknown: it is requested anew
            raise
        if not sample.missing():
            del self._partial[number]
            self._on_data(sample.whole(part))

    def _request_fragments(self, number: int, last: int | None = None) -> None:
        """Request the missing fragments, up to `last`, of an incomplete sample."""
        missing = self._partial[number].missing(last) if number in self._partial else ()
        if missing:
            self._acknacks += 1
            self._send(
                [encode_nack_fragments(self._writer_id, self.reader_id, number, missing, self._acknacks)]
            )

    def _on_heartbeat(self, heartbeat: Heartbeat) -> None:
        """Request the samples and fragments of the writer missing here."""
        self._skip_to(heartbeat.first)
        missing = [
            number
            for number in range(self._expected, min(heartbeat.last + 1, self._expected + _HISTORY))
            if number not in self._early and number not in self._partial
        ]
        if missing or not heartbeat.is_final:
            self._send_acknack(self._expected, missing)
        for number in tuple(self._partial):
            self._request_fragments(number)

    def _on_gap(self, gap: Gap) -> None:
        """Do not wait for irrelevant samples any more."""
        for number in gap.others:
            if self._expected <= number < self._expected + _HISTORY:
                self._early.setdefault(number, None)
                self._partial.pop(number, None)
        if gap.start <= self._expected:
            self._skip_to(gap.base)
        self._deliver_next()

    def _skip_to(self, first: int) -> None:
        if first > self._expected:
            self._expected = first
            self._early = {number: sample for number, sample in self._early.items() if number >= first}
            self._partial = {number: sample for number, sample in self._partial.items() if number >= first}
        self._deliver_next()

    def _deliver_next(self) -> None:
        while self._expected in self._early:
            sample = self._early.pop(self._expected)
            self._expected += 1
            if sample is not None:
                self._deliver(sample)
