"""Moments of a recorded session as pictures: the scene of its robot, with all soft bodies and markers."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from engines.mujoco import model
from engines.mujoco.markers.store import ShownMarker, shown_markers
from engines.mujoco.params import MujocoParams, SceneParams
from engines.mujoco.pictures.clearest_view import Sight, clearest_position
from engines.mujoco.pictures.drawing import find_drawing
from engines.mujoco.pictures.endoscope_params import EndoscopeParams, ViewParams
from engines.mujoco.pictures.endoscope_scene import EndoscopeScene
from engines.mujoco.pictures.soft_body import SoftBody
from hub.recording.bag import BagMessage, output_port
from hub.recording.moments import Moments
from hub.recording.recording import Recording
from hub.recording.trust import trusted_parameters
from schemas.codec import decode
from schemas.errors import MessageError, RecordingError, ScenarioError, TrocarError
from schemas.message import Message
from schemas.scenario import ParticipantSpec
from schemas.trocar_msgs import ShownMarkers, SoftBodyState, SurfaceChange, SurfaceFilm
from schemas.vectors import Vector, VectorCodec

__all__ = ["Camera", "RecordedScene"]

_log = logging.getLogger(__name__)

Camera = Literal["overview", "left", "right"]

Point = tuple[float, float, float]

M = TypeVar("M", bound=Message)

_DISTANCE, _LEAST = 1.4, 0.06
"""Distance of the overview, in diagonals of the box around the subject; the least side of the box, m."""
_REACH = 0.1
"""Distance from the subject within which a tip belongs to the subject, m."""
_STATES = 5
"""Most states of the robot that count for the place of the overview."""
_LENS = ("field_of_view", "baseline", "near", "far", "distortion", "sensor", "place")
_OVERSAMPLING = 2
"""Pixels drawn for each one of the picture, along either side: smooths edges."""
_FINE_PIXELS = 1024
"""Largest picture, along either side, drawn finer: both eyes are drawn side by side."""


class RecordedScene:
    """The robot of a recording and all soft bodies in it."""

    def __init__(
        self,
        recording: Recording,
        robot: str | None = None,
        *,
        looks: Literal["plain", "endoscope"] = "plain",
        trust: bool = False,
    ) -> None:
        """Find the participant `robot`, by default the first of kind mujoco; `trust` allows changed files.

        Raises RecordingError if there is none, or if no scene can be built of its parameters, and TrustError
        if these name files with other contents than the recorded ones.
        """
        self._recording, self._looks = recording, looks
        participants = recording.scenario().participants
        robots = [name for name, spec in participants.items() if spec.kind == "mujoco"]
        if not robots or robot not in (None, *robots):
            asked = "" if robot is None else f" of '{robot}'"
            raise RecordingError(
                f"'{recording.file}': no scene{asked}; participants of kind mujoco:"
                f" {', '.join(robots) or 'none'}"
            )
        name = robot or robots[0]
        parameters = trusted_parameters(recording, [name], trust=trust)
        try:
            params = parameters.validate_last(name)
        except ScenarioError as error:
            raise RecordingError(f"'{recording.file}': no scene of '{name}' can be built: {error}") from error
        if not isinstance(params, MujocoParams):
            raise TypeError(f"{params} are no parameters of kind mujoco")
        self._params, self._files = params, parameters.files
        self._qpos = f"/engine/{name}/out/qpos"
        self._skins, self._recorded_lens = _skins(participants), _recorded_lens(participants)
        self._room_view = _room_view(participants)
        self._nodes = _by_body(
            [topic for topic, kind in recording.topics.items() if kind == SoftBodyState.ros_type]
        )
        self._markers = [topic for topic, kind in recording.topics.items() if kind == ShownMarkers.ros_type]

    def picture(
        self,
        time_ns: int,
        camera: Camera,
        size: tuple[int, int],
        position: Point | None = None,
        target: Point | None = None,
    ) -> NDArray[np.uint8]:
        """Return the picture at `time_ns`; arguments, errors and shape are those of `pictures`."""
        return next(self.pictures([time_ns], camera, size, position, target))

    def pictures(
        self,
        times_ns: Sequence[int],
        camera: Camera,
        size: tuple[int, int],
        position: Point | None = None,
        target: Point | None = None,
    ) -> Iterator[NDArray[np.uint8]]:
        """Yield the picture at each of `times_ns`, shape (height, width, 3), RGB.

        Args:
            times_ns: simulated times, ascending; a picture shows the newest state published by then, and the
                soft bodies known at the first of them.
            camera: `left` or `right` of the endoscope, or `overview`.
            size: width and height, pixels.
            position: where the overview looks from, m in the world; default: the scenario's own camera in the
                room, else a place from which the arms hide least.
            target: where it looks at, m in the world; default: of the scenario's own camera, else the middle
                of soft bodies, objects and instruments beside them, over the whole recording.

        Raises RecordingError if the recording does not contain what is asked for, TrocarError if nothing can
        be drawn on this machine.
        """
        bodies = self._bodies_at(times_ns[0])
        finer = _OVERSAMPLING if max(size) <= _FINE_PIXELS else 1
        shown: dict[str, Any] = {"width": finer * size[0], "height": finer * size[1]}
        if camera == "overview":
            view = self._room_view if position is None and target is None else None
            view = view or self._overview_camera(bodies, position, target)
            shown |= {"view": view, "baseline": 0.0}
        elif not self._has_endoscope:
            raise RecordingError(
                f"'{self._recording.file}': no ECM in the scene, so there is no '{camera}' picture of an"
                " endoscope; take the overview"
            )
        else:
            shown |= self._recorded_lens
        for left, right in self._draw(times_ns, shown, bodies):
            yield _reduce_picture(right if camera == "right" else left, finer)

    def stereo(
        self, times_ns: Iterable[int], size: tuple[int, int]
    ) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.uint8]]]:
        """Yield the pictures of both eyes at each of `times_ns`, shape (height, width, 3), RGB.

        They are what the endoscope of the session would publish at this size, always with the looks of arms.
        In a scene without ECM two cameras, as far apart as its eyes, look at the soft bodies and objects, or
        at the whole scene.

        Args:
            times_ns: simulated times, ascending; a picture shows the newest state published by then.
            size: width and height, pixels.

        Raises what `picture` raises.
        """
        bodies = self._bodies_at(0)
        shown: dict[str, Any] = {"width": size[0], "height": size[1]}
        if self._has_endoscope:
            shown |= self._recorded_lens
        elif bodies or self._params.objects:
            shown["view"] = self._overview_camera(bodies, None, None)
        yield from self._draw(times_ns, shown, bodies)

    @property
    def _has_endoscope(self) -> bool:
        return "ECM" in self._params.arms

    def _draw(
        self, times_ns: Iterable[int], shown: Mapping[str, Any], bodies: Mapping[str, SoftBody]
    ) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.uint8]]]:
        """Yield both pictures at each time with the cameras `shown`; `bodies` are moved."""
        drawing = find_drawing(self._looks)
        if not drawing.engine:
            raise TrocarError(f"'{self._recording.file}' {drawing.shortcoming}")
        if drawing.shortcoming:
            _log.warning("'%s' %s", self._recording.file, drawing.shortcoming)
        # a default that is stated may be refused
        stated = self._params.model_dump(include=set(SceneParams.model_fields), exclude_unset=True)
        looks = {"looks": self._looks, "skins": {name: self._skins.get(name, {}) for name in bodies}}
        size = {"width": shown["width"], "height": shown["height"]}
        others = {name: value for name, value in shown.items() if name not in size}
        params = EndoscopeParams.model_validate(stated | looks | others, context=self._files.context)
        params = params.model_copy(update=size)  # a file may be larger than a message
        positions = _Newest(self._recording, self._qpos)
        nodes = {name: _Newest(self._recording, self._nodes[name]) for name in bodies}
        changes = {
            name: _Newest(self._recording, topic)
            for name in bodies
            if (topic := self._change_topic(self._nodes[name])) is not None
        }
        films = {
            name: _Newest(self._recording, topic)
            for name in bodies
            if (topic := self._film_topic(self._nodes[name])) is not None
        }
        markers = [_Newest(self._recording, topic) for topic in self._markers]
        scene = EndoscopeScene(params, drawing.engine, bodies)
        try:
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
                positioned = self._positions(positions.at(time_ns), time_ns)
                yield scene.draw(positioned, self._shown(markers, time_ns), time_ns)
        finally:
            scene.close()

    def _states(self) -> list[Vector]:
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

    def _bodies_at(self, time_ns: int) -> dict[str, SoftBody]:
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

    def _overview_camera(
        self,
        bodies: Mapping[str, SoftBody],
        position: Point | None,
        target: Point | None,
    ) -> ViewParams:
        if position is not None and target is not None:
            return ViewParams(position=position, target=target)
        sight = Sight(model.build(self._params), self._states())
        things, tips = sight.seen(self._params.objects)
        points = [body.rest.astype(np.float64) for body in bodies.values()]
        points += [things] if len(things) else []
        if not points:
            raise RecordingError(
                f"'{self._recording.file}': neither soft bodies nor objects to look at; give the overview a"
                " position and a target"
            )
        subject = np.concatenate(points)
        near = np.linalg.norm(tips - subject.mean(axis=0), axis=1) < _REACH
        cloud = np.concatenate([subject, tips[near]])
        low, high = cloud.min(axis=0), cloud.max(axis=0)
        centre = 0.5 * (low + high) if target is None else np.array(target)
        if position is None:
            size = np.maximum(high - low, _LEAST)
            away = _DISTANCE * float(np.linalg.norm(size))
            position = tuple(clearest_position(sight, centre, size, away))
        return ViewParams(position=position, target=tuple(centre))


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


def _skins(participants: Mapping[str, ParticipantSpec]) -> dict[str, Any]:
    """Return how the scenario's own cameras show each soft body."""
    return {
        name: look
        for spec in participants.values()
        if spec.kind == "endoscope"
        for name, look in spec.params.get("skins", {}).items()
    }


def _recorded_lens(participants: Mapping[str, ParticipantSpec]) -> dict[str, Any]:
    """Return the scenario's parameters of the cameras of its endoscope, if it has one."""
    for spec in participants.values():
        if spec.kind == "endoscope" and "view" not in spec.params:
            return {name: value for name, value in spec.params.items() if name in _LENS}
    return {}


def _room_view(participants: Mapping[str, ParticipantSpec]) -> ViewParams | None:
    """Return where the scenario's own camera in the room stands, if it has one."""
    for spec in participants.values():
        if spec.kind == "endoscope" and spec.params.get("view") is not None:
            return ViewParams.model_validate(spec.params["view"])
    return None


def _reduce_picture(picture: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    height, width, _ = picture.shape
    blocks = picture.reshape(height // factor, factor, width // factor, factor, 3)
    return blocks.mean(axis=(1, 3)).astype(np.uint8)
