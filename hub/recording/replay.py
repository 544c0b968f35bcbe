"""Publishes a recorded session again, so that consoles show the session as if live."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass
from threading import Event

import zenoh

from hub.recording.recording import ENERGY_PREFIX, STATUS_TOPIC, Recording
from hub.transport.envelope import Tag
from schemas.errors import RecordingError
from schemas.keys import ROOT, valid_session_name

__all__ = ["ReplaySummary", "is_replayed", "replay"]


@dataclass(frozen=True)
class ReplaySummary:
    """Counts and times of the messages published again."""

    session: str
    messages: int
    by_topic: dict[str, int]
    """Messages published of each topic."""
    sim_time_s: float
    """Simulated time between the first and the last message."""
    wall_time_s: float
    interrupted: bool
    """Stopped before the end."""


def is_replayed(topic: str) -> bool:
    """Return whether `topic` is published again: outputs, energy books and the status.

    Grants and acks are not: both would drive participants.
    """
    role, _, rest = topic[1:].partition("/")
    return (
        topic == STATUS_TOPIC
        or topic.startswith(ENERGY_PREFIX)
        or (role in ("engine", "device") and "/out/" in rest)
    )


def replay(
    recording: Recording,
    session: zenoh.Session,
    rate: float = 1.0,
    *,
    name: str | None = None,
    stop: Event | None = None,
) -> ReplaySummary:
    """Publish the recorded values on the keys of session `name`, by default the recorded name.

    `rate` is simulated seconds per wall second; 0 is as fast as possible. Ctrl-C, or `stop` set by another
    thread, ends the replay early. Raises RecordingError if the recording has no outputs, or if `name` is not
    a session name.
    """
    name = recording.session() if name is None else name
    if not valid_session_name(name):
        raise RecordingError(
            f"'{name}' is not a session name: a letter, then letters, digits, hyphens and underscores"
        )
    topics = [topic for topic in recording.topics if is_replayed(topic)]
    if not topics:
        raise RecordingError(
            f"'{recording.file}' holds no outputs of a session; its topics:"
            f" {', '.join(sorted(recording.topics)) or 'none'}"
        )
    player = _Player(recording, rate, stop or Event())
    begin = time.monotonic()
    with ExitStack() as stack:
        encoding, reliable = zenoh.Encoding.APPLICATION_CDR, zenoh.CongestionControl.BLOCK
        publishers = {
            topic: stack.enter_context(
                session.declare_publisher(
                    f"{ROOT}/{name}{topic}", encoding=encoding, congestion_control=reliable
                )
            )
            for topic in topics
        }
        try:
            interrupted = not player.play(publishers)
        except KeyboardInterrupt:
            interrupted = True
    return ReplaySummary(
        name,
        sum(player.by_topic.values()),
        player.by_topic,
        player.sim_time_ns * 1e-9,
        time.monotonic() - begin,
        interrupted,
    )


class _Player:
    """Publishes the messages of a recording at the recorded pace, and counts."""

    def __init__(self, recording: Recording, rate: float, stop: Event) -> None:
        self._recording, self._rate, self._stop = recording, rate, stop
        self._step_ns = recording.scenario().step
        first = next(recording.grants(), None)
        self._run = 0 if first is None else first.run
        self.by_topic: dict[str, int] = {}
        self.sim_time_ns = 0

    def play(self, publishers: dict[str, zenoh.Publisher]) -> bool:
        """Publish every message of the topics; return False if stopped before the end."""
        start_ns, begin = None, time.monotonic()
        for message in self._recording.messages(*publishers):
            start_ns = message.time_ns if start_ns is None else start_ns
            self.sim_time_ns = max(self.sim_time_ns, message.time_ns - start_ns)
            ahead = (
                begin + (message.time_ns - start_ns) * 1e-9 / self._rate - time.monotonic()
                if self._rate
                else 0.0
            )
            if self._stop.wait(ahead) if ahead > 0 else self._stop.is_set():
                return False
            tag = Tag.pack(self._run, 0, message.time_ns // self._step_ns, message.time_ns)
            publishers[message.topic].put(message.payload, attachment=tag)  # pyright: ignore[reportUnknownMemberType]
            self.by_topic[message.topic] = self.by_topic.get(message.topic, 0) + 1
        return True
