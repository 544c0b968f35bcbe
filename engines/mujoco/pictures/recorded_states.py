"""Instants of a recorded session: positions of the robot's joints, soft bodies, markers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TypeVar

import numpy as np

from engines.mujoco.markers.store import ShownMarker, shown_markers
from engines.mujoco.pictures.soft_body import SoftBody
from hub.recording.bag import BagMessage
from hub.recording.moments import Moments
from hub.recording.output_port import output_port
from hub.recording.recording import Recording
from schemas.codec import decode
from schemas.errors import MessageError, RecordingError
from schemas.message import Message
from schemas.trocar_msgs import ShownMarkers, SoftBodyState, SurfaceChange, SurfaceFilm
from schemas.vectors import Vector, VectorCodec

__all__ = ["RecordedStates"]

M = TypeVar("M", bound=Message)

_STATES = 5
"""Most states of the robot that `some_positions` returns."""


class RecordedStates:
    """What a recording has for pictures of one robot, all soft bodies and all markers."""

    def __init__(self, recording: Recording, robot: str) -> None:
        self._recording = recording
        self._qpos = f"/engine/{robot}/out/qpos"
        self._nodes = _by_body(
            [topic for topic, kind in recording.topics.items() if kind == SoftBodyState.ros_type]
        )
        self._markers = [topic for topic, kind in recording.topics.items() if kind == ShownMarkers.ros_type]

    def bodies_at(self, time_ns: int) -> dict[str, SoftBody]:
        """Return the soft bodies that are known at a time, as their first messages describe them."""
        bodies: dict[str, SoftBody] = {}
        for name, topic in self._nodes.items():
            first = next(self._recording.messages(topic), None)
            if first is not None and first.time_ns <= time_ns:
                may_change, wet = self._change_topic(topic) is not None, self._film_topic(topic)
                bodies[name] = SoftBody(
                    topic, may_change=may_change, may_be_wet=may_change and wet is not None
                )
                film = None if wet is None else next(self._recording.messages(wet), None)
                bodies[name].accept(
                    self._decoded(SoftBodyState, first),
                    film=None if film is None else self._decoded(SurfaceFilm, film),
                )
        return bodies

    def instants(
        self, times_ns: Iterable[int], bodies: Mapping[str, SoftBody]
    ) -> Iterator[tuple[int, Vector, list[ShownMarker]]]:
        """Yield time, joint positions, shape (nq,), and markers at each of `times_ns`; `bodies` are moved.

        Times ascend; the newest state published by then counts. Raises RecordingError if there is none.
        """
        positions = _Newest(self._recording, self._qpos)
        nodes = {name: _Newest(self._recording, self._nodes[name]) for name in bodies}
        topics = {name: self._change_topic(self._nodes[name]) for name in bodies}
        changes = {name: _Newest(self._recording, topic) for name, topic in topics.items() if topic}
        topics = {name: self._film_topic(self._nodes[name]) for name in bodies}
        films = {name: _Newest(self._recording, topic) for name, topic in topics.items() if topic}
        markers = [_Newest(self._recording, topic) for topic in self._markers]
        for time_ns in times_ns:
            for name, newest in nodes.items():
                if (message := newest.at(time_ns)) is not None:
                    change = changes[name].at(time_ns) if name in changes else None
                    film = films[name].at(time_ns) if name in films else None
                    bodies[name].accept(
                        self._decoded(SoftBodyState, message),
                        None if change is None else self._decoded(SurfaceChange, change),
                        None if film is None else self._decoded(SurfaceFilm, film),
                    )
            yield time_ns, self._positions(positions.at(time_ns), time_ns), self._shown(markers, time_ns)

    def some_positions(self) -> list[Vector]:
        """Return positions of the robot's joints, shape (nq,) each, at instants all over the recording."""
        bag, moments = self._recording, Moments(self._recording)
        times = np.linspace(0, bag.duration_ns, _STATES, dtype=np.int64).tolist()
        found = [moments.newest(self._qpos, time) for time in times] if self._qpos in bag.topics else []
        return [self._positions(newest, newest.time_ns) for newest in found if newest is not None]

    def _shown(self, markers: Iterable[_Newest], time_ns: int) -> list[ShownMarker]:
        """Return the markers that are shown at `time_ns`, of all participants that keep some."""
        messages = (message for newest in markers if (message := newest.at(time_ns)) is not None)
        return [one for message in messages for one in shown_markers(self._decoded(ShownMarkers, message))]

    def _positions(self, newest: BagMessage | None, time_ns: int) -> Vector:
        if newest is None:
            raise RecordingError(
                f"'{self._recording.file}': nothing on '{self._qpos}' up to {time_ns * 1e-9:g} s"
            )
        return VectorCodec(output_port(newest.topic, newest.type, newest.payload)).decode(newest.payload)

    def _change_topic(self, nodes: str) -> str | None:
        """Return the topic with the changes of the surface of a soft body; None without."""
        topic = f"{nodes.removesuffix('nodes')}surface"
        return topic if self._recording.topics.get(topic) == SurfaceChange.ros_type else None

    def _film_topic(self, nodes: str) -> str | None:
        """Return the topic with the liquid on a soft body; None without."""
        topic = f"{nodes.removesuffix('nodes')}film"
        return topic if self._recording.topics.get(topic) == SurfaceFilm.ros_type else None

    def _decoded(self, model: type[M], message: BagMessage) -> M:
        try:
            return decode(model, message.payload)
        except MessageError as error:
            raise RecordingError(f"'{self._recording.file}': topic '{message.topic}': {error}") from error


class _Newest:
    """The newest message of a topic at times that ascend."""

    def __init__(self, recording: Recording, topic: str) -> None:
        self._messages = recording.messages(topic)
        self._next = next(self._messages, None)
        self._newest: BagMessage | None = None

    def at(self, time_ns: int) -> BagMessage | None:
        """Return the newest message up to `time_ns`; None if there is none."""
        while self._next is not None and self._next.time_ns <= time_ns:
            self._newest, self._next = self._next, next(self._messages, None)
        return self._newest


def _by_body(topics: list[str]) -> dict[str, str]:
    """Return the topics of soft bodies by name: `<organ>`, or `<engine>_<organ>` if several share it."""
    ends = [topic.split("/") for topic in topics]  # /engine/<participant>/out/<organ>/nodes
    organs = [end[-2] for end in ends]
    return {
        end[-2] if organs.count(end[-2]) == 1 else f"{end[2]}_{end[-2]}": topic
        for end, topic in zip(ends, topics, strict=True)
    }
