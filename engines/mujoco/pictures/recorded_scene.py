"""Moments of a recorded session as pictures: the scene of its robot, with all soft bodies and markers."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from engines.mujoco import model
from engines.mujoco.params import MujocoParams, SceneParams
from engines.mujoco.pictures.clearest_view import Sight, clearest_position
from engines.mujoco.pictures.drawing import find_drawing
from engines.mujoco.pictures.endoscope_params import EndoscopeParams, ViewParams
from engines.mujoco.pictures.endoscope_scene import EndoscopeScene
from engines.mujoco.pictures.recorded_states import RecordedStates
from engines.mujoco.pictures.soft_body import SoftBody
from hub.recording.recording import Recording
from hub.recording.trust import trusted_parameters
from schemas.errors import RecordingError, ScenarioError, TrocarError
from schemas.scenario import ParticipantSpec

__all__ = ["Camera", "Point", "RecordedScene"]

_log = logging.getLogger(__name__)

Camera = Literal["overview", "left", "right"]

Point = tuple[float, float, float]

_DISTANCE, _LEAST = 1.4, 0.06
"""Distance of the overview, in diagonals of the box around the subject; the least side of the box, m."""
_REACH = 0.1
"""Distance from the subject within which a tip belongs to the subject, m."""
_LENS = ("field_of_view", "baseline", "near", "far", "distortion")
_APPEARANCE = ("sensor", "place", "smoke", "randomise")
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
        looks: Literal["plain", "endoscope"] | None = "plain",
        randomise: int | None = None,
        trust: bool = False,
    ) -> None:
        """Find the participant `robot`, by default the first of kind mujoco.

        Args:
            recording: of a session.
            robot: name of the participant.
            looks: of all pictures; None: those of the recorded camera.
            randomise: seed of differences of what is seen, for the recorded one; None: as recorded.
            trust: allow changed files.

        Raises RecordingError if there is none, or if no scene can be built of its parameters, and TrustError
        if these name files with other contents than the recorded ones.
        """
        self._recording = recording
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
        self.states = RecordedStates(recording, name)
        """Positions of the joints, soft bodies and markers at each instant."""
        self._skins = _skins(participants)
        self._endoscope = _recorded_camera(participants, in_room=False)
        self._room = _recorded_camera(participants, in_room=True)
        self._looks = looks or _recorded_looks(participants)
        for camera in () if randomise is None else (self._endoscope, self._room):
            camera["randomise"] = (camera.get("randomise") or {}) | {"seed": randomise}

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
        bodies = self.states.bodies_at(times_ns[0])
        finer = _OVERSAMPLING if max(size) <= _FINE_PIXELS else 1
        params = self.camera(bodies, camera, (finer * size[0], finer * size[1]), position, target)
        for left, right in self._draw(times_ns, params, bodies):
            yield _reduce_picture(right if camera == "right" else left, finer)

    def camera(
        self,
        bodies: Mapping[str, SoftBody],
        camera: Camera,
        size: tuple[int, int],
        position: Point | None = None,
        target: Point | None = None,
    ) -> EndoscopeParams:
        """Return the scene with the cameras for `pictures`, which has the other arguments too.

        Raises RecordingError if the recording has no such camera.
        """
        if camera == "overview":
            view = self._room.get("view") if position is None and target is None else None
            view = view or self._overview_camera(bodies, position, target)
            look = {name: value for name, value in self._room.items() if name in _APPEARANCE}
            return self._camera_params(look | {"view": view, "baseline": 0.0}, size, bodies)
        if not self._has_endoscope:
            raise RecordingError(
                f"'{self._recording.file}': no ECM in the scene, so there is no '{camera}' picture of an"
                " endoscope; take the overview"
            )
        return self._camera_params(self._endoscope, size, bodies)

    def stereo(
        self, times_ns: Iterable[int], size: tuple[int, int]
    ) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.uint8]]]:
        """Yield the pictures of both eyes at each of `times_ns`, shape (height, width, 3), RGB.

        They are what the endoscope of the session would publish at this size, always with the looks of arms.
        In a scene without ECM they are those of the scenario's own camera in the room, else two cameras, as
        far apart as its eyes, look at the soft bodies and objects, or at the whole scene.

        Args:
            times_ns: simulated times, ascending; a picture shows the newest state published by then.
            size: width and height, pixels.

        Raises what `picture` raises.
        """
        bodies = self.states.bodies_at(0)
        yield from self._draw(times_ns, self.stereo_camera(bodies, size), bodies)

    def stereo_camera(self, bodies: Mapping[str, SoftBody], size: tuple[int, int]) -> EndoscopeParams:
        """Return the scene with the cameras of `stereo`."""
        if self._has_endoscope:
            shown = self._endoscope
        elif "view" in self._room or not (bodies or self._params.objects):
            shown = self._room
        else:
            shown = self._room | {"view": self._overview_camera(bodies, None, None)}
        return self._camera_params(shown, size, bodies)

    @property
    def _has_endoscope(self) -> bool:
        return "ECM" in self._params.arms

    def _camera_params(
        self, shown: Mapping[str, Any], size: tuple[int, int], bodies: Mapping[str, SoftBody]
    ) -> EndoscopeParams:
        """Return the scene with soft bodies, and cameras as `shown`."""
        # a default that is stated may be refused
        stated = self._params.model_dump(include=set(SceneParams.model_fields), exclude_unset=True)
        looks = {"looks": self._looks, "skins": {name: self._skins.get(name, {}) for name in bodies}}
        params = EndoscopeParams.model_validate({**stated, **looks, **shown}, context=self._files.context)
        # a file may be larger than a message
        return params.model_copy(update={"width": size[0], "height": size[1]})

    def _draw(
        self, times_ns: Iterable[int], params: EndoscopeParams, bodies: Mapping[str, SoftBody]
    ) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.uint8]]]:
        """Yield both pictures at each time; `bodies` are moved."""
        drawing = find_drawing(self._looks)
        if not drawing.engine:
            raise TrocarError(f"'{self._recording.file}' {drawing.shortcoming}")
        if drawing.shortcoming:
            _log.warning("'%s' %s", self._recording.file, drawing.shortcoming)
        scene = EndoscopeScene(params, drawing.engine, bodies)
        try:
            for time_ns, positions, markers in self.states.instants(times_ns, bodies):
                yield scene.draw(positions, markers, time_ns)
        finally:
            scene.close()

    def _overview_camera(
        self,
        bodies: Mapping[str, SoftBody],
        position: Point | None,
        target: Point | None,
    ) -> ViewParams:
        if position is not None and target is not None:
            return ViewParams(position=position, target=target)
        sight = Sight(model.build(self._params), self.states.some_positions())
        things, tips = sight.seen(self._params.objects)
        points = [body.rest.astype(np.float64) for body in bodies.values()]
        points += [things] if len(things) else []
        points = points or [tips]
        if not points[0].size:
            raise RecordingError(
                f"'{self._recording.file}': no soft bodies, objects or tips to look at; give the overview a"
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


def _skins(participants: Mapping[str, ParticipantSpec]) -> dict[str, Any]:
    """Return how the scenario's own cameras show each soft body."""
    return {
        name: look
        for spec in participants.values()
        if spec.kind == "endoscope"
        for name, look in spec.params.get("skins", {}).items()
    }


def _recorded_camera(participants: Mapping[str, ParticipantSpec], *, in_room: bool) -> dict[str, Any]:
    """Return the scenario's parameters of the cameras of its endoscope, or in the room; empty without."""
    names = (*_LENS, *_APPEARANCE, "view")
    for spec in participants.values():
        if spec.kind == "endoscope" and (spec.params.get("view") is not None) == in_room:
            return {name: value for name, value in spec.params.items() if name in names}
    return {}


def _recorded_looks(participants: Mapping[str, ParticipantSpec]) -> Literal["plain", "endoscope"]:
    """Return the looks of the scenario's cameras: `endoscope` if any has them."""
    looks = [spec.params.get("looks") for spec in participants.values() if spec.kind == "endoscope"]
    return "endoscope" if "endoscope" in looks else "plain"


def _reduce_picture(picture: NDArray[np.uint8], factor: int) -> NDArray[np.uint8]:
    height, width, _ = picture.shape
    blocks = picture.reshape(height // factor, factor, width // factor, factor, 3)
    return blocks.mean(axis=(1, 3)).astype(np.uint8)
