"""Plays an operator's commands and a real dVRK's states from a ROS bag: the kind `ros-bag`.

Time 0 is the first message of the bag on any topic, and the times of recording give the pace, as in `ros2 bag
play`. Ports have the names of a gateway's ports, and messages are refused by the same rules; stamps become
the times of playing. docs/decisions/0033-bags.md.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path

from devices.ros.bags.params import BagParams, listed_topics
from devices.ros.topics.row import Row
from devices.ros.topics.state_commands import RepeatedStateCommands
from devices.ros.topics.validation import as_signal, validate
from devices.samples import Playback, clock_of, stamp_message, stamp_of
from hub.participant import Device, Sample
from hub.recording.ros_bag_reader import RosBag
from hub.transport.refusals import Refusals
from schemas.codec import message_type, validate_message
from schemas.errors import MessageError
from schemas.message import Message
from schemas.ports import Port

__all__ = ["BagPlayer"]

log = logging.getLogger(__name__)

_LATCHED_NS = 1_000_000_000
"""Age of a state command at its recording, beyond which the command was delivered, latched, to a late
recorder; a CRTK client considers a connection lost after the same time.
"""


class BagPlayer(Device):
    """The kind `ros-bag`."""

    params_model = BagParams
    params: BagParams
    simulated_time = True

    def __init__(self, name: str, params: BagParams) -> None:
        super().__init__(name, params)
        self._bag: RosBag | None = None
        self._refusals = Refusals()
        self._playback = Playback()

    @property
    def ports(self) -> tuple[Port, ...]:
        """An output for each topic in the bag, named as a gateway's."""
        return self._ports

    @cached_property
    def _ports(self) -> tuple[Port, ...]:
        with RosBag(self.params.bag) as bag:
            topics = {row.topic for row in self.params.played(bag.topics).values()}
        ports = [
            row.port
            for row in self.params.subscribed.values()
            if row.topic in topics and row.port is not None
        ]
        return tuple(
            port.model_copy(
                update={
                    "clock": clock_of(simulated_time=self.simulated_time),
                    "max_age_ns": round(port.max_age_ns / self.params.rate),
                }
            )
            for port in ports
        )

    # the validated parameters have the bag's whole path
    def open(self, directory: Path) -> None:  # noqa: ARG002
        """Open the bag, and log unplayed topics. Raises RecordingError for an unreadable bag."""
        self.close()
        self._bag = bag = RosBag(self.params.bag)
        played = self.params.played(bag.topics)
        ignored = {topic: its for topic, its in bag.topics.items() if topic not in played}
        if ignored:
            log.info(
                "device '%s': topics of '%s' that no port here takes are ignored: %s",
                self.name,
                bag.path,
                listed_topics(ignored),
            )
        self._refusals = Refusals()
        self._playback = Playback(self._play(bag, played))

    def read(self, t: int) -> list[Sample]:
        """Return the samples since the last call up to time `t`, oldest first."""
        return self._playback.due(t)

    def close(self) -> None:
        """Close the bag."""
        self._playback = Playback()
        if self._bag is not None:
            self._bag.close()
        self._bag = None

    def _play(self, bag: RosBag, played: Mapping[str, Row]) -> Iterator[tuple[int, Sample]]:
        """Yield (time in ns, sample) of all accepted messages, in order."""
        start_ns = bag.start_ns + self.params.start
        filters = {row.topic: _Filter(row) for row in played.values()}
        for topic, recorded_ns, raw in bag.messages(played, start_ns):
            row, time_ns = played[topic], round((recorded_ns - start_ns) / self.params.rate)
            try:
                message = filters[row.topic].accepted(raw, recorded_ns)
            except MessageError as error:
                self._refusals.refuse(f"'{self.name}': {topic}", f"{error} (at {time_ns / 1e9:g} s)")
                continue
            if row.port is not None:
                yield time_ns, Sample(row.port.name, stamp_message(message, time_ns))


class _Filter:
    """Refuses messages of a row by a gateway's rules."""

    def __init__(self, row: Row) -> None:
        self._row, self._model = row, message_type(row.type)
        self._repeated = RepeatedStateCommands()

    def accepted(self, raw: object, recorded_ns: int) -> Message:
        """Return a recorded message in the row's type. Raises MessageError for a refused message."""
        if isinstance(raw, Exception):
            raise MessageError(f"no such message ({type(raw).__name__}: {raw})")
        message = validate_message(self._model, raw)
        validate(message, self._row)
        stamp_ns, port = stamp_of(message), self._row.port
        if self._row.name == "state_command" and stamp_ns:
            self._check_latched(stamp_ns, recorded_ns)
        if port is None or port.variability == "event":
            return message
        if stamp_ns == 0:
            raise MessageError("marked invalid (stamp 0)")
        return as_signal(message, port)

    def _check_latched(self, stamp_ns: int, recorded_ns: int) -> None:
        """Raise MessageError for an old state command delivered by a new connection."""
        ago_ns = recorded_ns - stamp_ns
        if ago_ns > _LATCHED_NS:
            raise MessageError(
                f"published {ago_ns / 1e9:.1f} s before it was recorded: a latched command, delivered when"
                " the recorder connected"
            )
        refusal = self._repeated.refusal(stamp_ns)
        if refusal is not None:
            raise MessageError(refusal)
