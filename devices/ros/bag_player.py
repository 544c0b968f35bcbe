"""Plays what a ROS bag holds of an operator's commands, and of a real dVRK's states: the kind `ros-bag`.

Time 0 is the first message of the bag, whatever its topic, and the times of recording give the pace, as in `ros2 bag play`. What is played comes out of ports
that are named as those of a gateway, and is refused by the same rules; stamps become the times of playing. docs/decisions/0033-bags.md.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from devices.ros.bag import BagTopic, RosBag
from devices.ros.face import face
from devices.ros.paper import paper_face
from devices.ros.params import GatewayParams, HeardParams
from devices.ros.row import Row
from devices.ros.rules import as_signal, check
from devices.ros.stamps import stamp_of, stamped
from hub.participant import Device, Sample
from hub.wire import Drops
from schemas.codec import message_type, validated
from schemas.errors import MessageError, RecordingError, did_you_mean
from schemas.message import Message
from schemas.ports import Port
from schemas.quantity import Duration

__all__ = ["BagParams", "BagPlayer"]

log = logging.getLogger(__name__)

_LATCHED_NS = 1_000_000_000
"""A state command that is older when it is recorded came by a late recorder's connection; a CRTK client takes a connection for lost after as long."""
_REMEMBERED = 8
"""State commands, as a gateway remembers them."""
_NAMED = 6
"""Topics that are named in one message."""


class BagParams(HeardParams):
    """Which bag is played, how, and what of it."""

    bag: Path = Field(description="rosbag2 directory, .mcap, .db3, or .bag of ROS 1, relative to the scenario")
    start: Duration = Field(default=0, ge=0, description="time of the bag at which playing begins")
    rate: float = Field(default=1.0, gt=0.0, allow_inf_nan=False, description="speed of playing; 2 is twice as fast as recorded")
    rename: Mapping[str, str] = Field(default={}, description="topics of the bag to topics of the dVRK: {/dvrk/PSM1/set_position_goal_joint: /PSM1/move_jp}")

    @field_validator("bag")
    @classmethod
    def _find(cls, bag: Path, info: ValidationInfo) -> Path:
        context: dict[str, Any] = info.context or {}
        return (Path(context.get("directory", Path.cwd())) / bag).resolve()

    @model_validator(mode="after")
    def _has_something_to_play(self) -> Self:
        try:
            with RosBag(self.bag) as bag:
                topics = bag.topics
        except RecordingError as error:
            raise ValueError(str(error)) from error
        unknown = next((topic for topic in self.rename if topic not in topics), None)
        if unknown is not None:
            raise ValueError(f"rename: '{self.bag}' has no topic '{unknown}'.{did_you_mean(unknown, topics)}")
        if not self.played(topics):
            hearable = ", ".join(row.topic for row in self.heard.values()) or "none: `arms` and `listen` are empty"
            raise ValueError(f"'{self.bag}' has nothing that could be played here. Its topics: {_listed(topics) or 'none'}. Topics that are heard: {hearable}")
        return self

    @property
    def heard(self) -> Mapping[str, Row]:
        """What a gateway would subscribe to, by topic."""
        shared = {name: getattr(self, name) for name in HeardParams.model_fields}
        params = GatewayParams(**shared)
        rows = face(params) if self.profile == "dvrk" else paper_face(params)
        return {row.topic: row for row in rows if row.way == "subscribe" and row.port is not None}

    def played(self, topics: Mapping[str, BagTopic]) -> Mapping[str, Row]:
        """Return which topics of a bag are played, and as what."""
        heard = self.heard
        rows = {topic: heard.get(self.rename.get(topic, topic)) for topic, told in topics.items() if told.messages}
        return {topic: row for topic, row in rows.items() if row is not None and row.type == topics[topic].type}


class BagPlayer(Device):
    """The kind `ros-bag`."""

    params_model = BagParams
    params: BagParams

    def __init__(self, name: str, params: BagParams) -> None:
        """Take the participant's name and what is to be played."""
        super().__init__(name, params)
        self._bag: RosBag | None = None
        self._drops = Drops()
        self._samples: Iterator[tuple[int, Sample]] = iter(())
        self._next: tuple[int, Sample] | None = None

    @property
    def ports(self) -> tuple[Port, ...]:
        """One output for each topic that is in the bag, named as a gateway's."""
        return self._ports

    @cached_property
    def _ports(self) -> tuple[Port, ...]:
        with RosBag(self.params.bag) as bag:
            topics = {row.topic for row in self.params.played(bag.topics).values()}
        ports = [row.port for row in self.params.heard.values() if row.topic in topics and row.port is not None]
        return tuple(port.model_copy(update={"clock": "simulated", "max_age_ns": round(port.max_age_ns / self.params.rate)}) for port in ports)

    def open(self, directory: Path) -> None:  # noqa: ARG002 - the bag was found when the parameters were validated
        """Open the bag, and say what of it is not played. Raises RecordingError if it cannot be read."""
        self.close()
        self._bag = bag = RosBag(self.params.bag)
        played = self.params.played(bag.topics)
        passed_over = {topic: told for topic, told in bag.topics.items() if topic not in played}
        if passed_over:
            log.info("device '%s': passed over of '%s', as nothing here hears them: %s", self.name, bag.path, _listed(passed_over))
        self._drops = Drops()
        self._samples = self._play(bag, played)
        self._next = next(self._samples, None)

    def read(self, t: int) -> list[Sample]:
        """Return the samples up to time `t` that were not returned before, oldest first."""
        due: list[Sample] = []
        while self._next is not None and self._next[0] <= t:
            due.append(self._next[1])
            self._next = next(self._samples, None)
        return due

    def close(self) -> None:
        """Close the bag."""
        self._samples, self._next = iter(()), None
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
                self._drops.refuse(f"'{self.name}': {topic}", f"{error} (at {time_ns / 1e9:g} s)")
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
            raise MessageError(f"given {ago_ns / 1e9:.1f} s before it was recorded, so it came by a connection (latched): nobody gave it then")
        if stamp_ns in self._heeded:
            raise MessageError(f"heeded before, with the same stamp, {stamp_ns / 1e9:.9f} s")
        self._heeded.append(stamp_ns)


def _listed(topics: Mapping[str, BagTopic]) -> str:
    """Return topics with their types and numbers of messages; of many, the first."""
    named = [f"{topic} ({told.type}, {told.messages})" for topic, told in sorted(topics.items())]
    return ", ".join(named[:_NAMED]) + (f" and {len(named) - _NAMED} more" if len(named) > _NAMED else "")
