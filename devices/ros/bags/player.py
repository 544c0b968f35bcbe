"""Plays what a ROS bag holds of an operator's commands, and of a real dVRK's states: the kind `ros-bag`.

Time 0 is the first message of the bag, whatever its topic, and the times of recording give the pace, as in
`ros2 bag play`. What is played comes out of ports that are named as those of a gateway, and is refused by the
same rules; stamps become the times of playing. docs/decisions/0033-bags.md.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path

from devices.playback import Playback
from devices.ros.bags.bag import RosBag
from devices.ros.bags.params import BagParams, listed
from devices.ros.topics.row import Row
from devices.ros.topics.rules import as_signal, check
from devices.ros.topics.stamps import stamp_of, stamped
from hub.participant import Device, Sample
from hub.transport.refusals import Refusals
from schemas.codec import message_type, validated
from schemas.errors import MessageError
from schemas.message import Message
from schemas.ports import Port

__all__ = ["BagPlayer"]

log = logging.getLogger(__name__)

_LATCHED_NS = 1_000_000_000
"""A state command that is older when it is recorded came by a late recorder's connection; a CRTK client takes
a connection for lost after as long.
"""
_REMEMBERED = 8
"""State commands, as a gateway remembers them."""


class BagPlayer(Device):
    """The kind `ros-bag`."""

    params_model = BagParams
    params: BagParams

    def __init__(self, name: str, params: BagParams) -> None:
        """Take the participant's name and what is to be played."""
        super().__init__(name, params)
        self._bag: RosBag | None = None
        self._refusals = Refusals()
        self._playback = Playback()

    @property
    def ports(self) -> tuple[Port, ...]:
        """One output for each topic that is in the bag, named as a gateway's."""
        return self._ports

    @cached_property
    def _ports(self) -> tuple[Port, ...]:
        with RosBag(self.params.bag) as bag:
            topics = {row.topic for row in self.params.played(bag.topics).values()}
        ports = [
            row.port for row in self.params.heard.values() if row.topic in topics and row.port is not None
        ]
        return tuple(
            port.model_copy(
                update={"clock": "simulated", "max_age_ns": round(port.max_age_ns / self.params.rate)}
            )
            for port in ports
        )

    def open(self, directory: Path) -> None:  # noqa: ARG002 - the bag was found when the parameters were validated
        """Open the bag, and say what of it is not played. Raises RecordingError if it cannot be read."""
        self.close()
        self._bag = bag = RosBag(self.params.bag)
        played = self.params.played(bag.topics)
        passed_over = {topic: told for topic, told in bag.topics.items() if topic not in played}
        if passed_over:
            log.info(
                "device '%s': passed over of '%s', as nothing here hears them: %s",
                self.name,
                bag.path,
                listed(passed_over),
            )
        self._refusals = Refusals()
        self._playback = Playback(self._play(bag, played))

    def read(self, t: int) -> list[Sample]:
        """Return the samples up to time `t` that were not returned before, oldest first."""
        return self._playback.due(t)

    def close(self) -> None:
        """Close the bag."""
        self._playback = Playback()
        if self._bag is not None:
            self._bag.close()
        self._bag = None

    def _play(self, bag: RosBag, played: Mapping[str, Row]) -> Iterator[tuple[int, Sample]]:
        """Yield (time in ns, sample) of all that is heeded, in order."""
        start_ns = bag.start_ns + self.params.start
        rules = {row.topic: _Rule(row) for row in played.values()}
        for topic, recorded_ns, raw in bag.messages(played, start_ns):
            row, time_ns = played[topic], round((recorded_ns - start_ns) / self.params.rate)
            try:
                message = rules[row.topic].heeded(raw, recorded_ns)
            except MessageError as error:
                self._refusals.refuse(f"'{self.name}': {topic}", f"{error} (at {time_ns / 1e9:g} s)")
                continue
            if row.port is not None:
                yield time_ns, Sample(row.port.name, stamped(message, time_ns))


class _Rule:
    """What a gateway refuses, too."""

    def __init__(self, row: Row) -> None:
        """Take what is played."""
        self._row, self._model = row, message_type(row.type)
        self._heeded: deque[int] = deque(maxlen=_REMEMBERED)

    def heeded(self, raw: object, recorded_ns: int) -> Message:
        """Return what was recorded as the row's message. Raises MessageError where it is not heeded."""
        if isinstance(raw, Exception):
            raise MessageError(f"no such message ({type(raw).__name__}: {raw})")
        message = validated(self._model, raw)
        check(message, self._row)
        stamp_ns, port = stamp_of(message), self._row.port
        if self._row.name == "state_command" and stamp_ns:
            self._be_new(stamp_ns, recorded_ns)
        if port is None or port.variability == "event":
            return message
        if stamp_ns == 0:
            raise MessageError("marked invalid (stamp 0)")
        return as_signal(message, port)

    def _be_new(self, stamp_ns: int, recorded_ns: int) -> None:
        """Raise MessageError for a state command that a connection has brought, though nobody gave it then."""
        ago_ns = recorded_ns - stamp_ns
        if ago_ns > _LATCHED_NS:
            raise MessageError(
                f"given {ago_ns / 1e9:.1f} s before it was recorded, so it came by a connection (latched):"
                " nobody gave it then"
            )
        if stamp_ns in self._heeded:
            raise MessageError(f"heeded before, with the same stamp, {stamp_ns / 1e9:.9f} s")
        self._heeded.append(stamp_ns)
