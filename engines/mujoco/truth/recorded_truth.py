"""Truth of a recording at the frames of a camera."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.recorded_states import RecordedStates
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.pictures.solid_meshes import Triangles
from engines.mujoco.truth.keypoints import InstrumentView
from engines.mujoco.truth.labels import Body
from engines.mujoco.truth.projection import Projection
from engines.mujoco.truth.sight import Motion, Sight, Viewpoint
from engines.mujoco.truth.surfaces import body_triangles
from engines.mujoco.truth.truth_scene import Instant, TruthScene
from robots.dvrk.endoscope import Eye
from schemas.errors import TrocarError
from schemas.vectors import Vector

__all__ = ["RecordedTruth", "TruthFrame"]


@dataclass(frozen=True)
class TruthFrame:
    """Truth of one picture."""

    time_ns: int
    sight: Sight
    motion: Motion | None
    """Motion until the next frame; None if not asked for."""
    instruments: Mapping[str, InstrumentView]
    """Instruments by the name of their arm."""
    poses: Mapping[str, Vector]
    """Rigid bodies in the optical frame, shape (4, 4), by name."""


class RecordedTruth:
    """Draws the truth of a recording; owns an OpenGL context."""

    def __init__(
        self, states: RecordedStates, params: EndoscopeParams, bodies: Mapping[str, SoftBody]
    ) -> None:
        """Prepare to draw, with scene and cameras of `params`. Raises TrocarError without OpenGL."""
        gl = opengl.find()
        if not gl.name:
            raise TrocarError(f"no OpenGL works here ({gl.detail}). To fix it: {opengl.REMEDY}")
        self._states, self._soft = states, bodies
        self.scene = TruthScene(params, gl.name, bodies)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.scene.close()

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies that pictures may show."""
        return self.scene.bodies

    @property
    def projection(self) -> Projection:
        """The camera of either eye."""
        return self.scene.projection

    def silhouette(self, frame: TruthFrame, body: Body) -> NDArray[np.bool_]:
        """Return the pixels, shape (height, width), that a body would have alone in the scene.

        `frame`: the one yielded last, without motion.
        """
        return self.scene.silhouette(frame.sight, body)

    def model(self, body: Body) -> Triangles:
        """Return the triangles of a rigid body in the body's frame, m."""
        model = self.scene.model
        return body_triangles(model, model.body(body.name).id)

    def frames(
        self, times_ns: Sequence[int], eyes: tuple[Eye, ...], after_ns: int | None = None
    ) -> Iterator[Mapping[Eye, TruthFrame]]:
        """Yield the truth at each of `times_ns`, ascending, by eye.

        With `after_ns`, the time of a frame after the last, each has the motion until the next.
        """
        times = [*times_ns] if after_ns is None else [*times_ns, after_ns]
        instants = self._instants(times, eyes)
        if after_ns is None:
            for time_ns, instant, known in instants:
                yield {eye: TruthFrame(time_ns, instant.sights[eye], None, **known[eye]) for eye in eyes}
            return
        for (time_ns, before, known), (_, now, _) in pairwise(instants):
            motions = {eye: self.scene.motion(before, eye, now) for eye in eyes}
            yield {eye: TruthFrame(time_ns, before.sights[eye], motions[eye], **known[eye]) for eye in eyes}

    def _instants(
        self, times_ns: Sequence[int], eyes: tuple[Eye, ...]
    ) -> Iterator[tuple[int, Instant, dict[Eye, dict[str, Any]]]]:
        for time_ns, positions, _ in self._states.instants(times_ns, self._soft):
            instant = self.scene.look(positions, eyes)
            known: dict[Eye, dict[str, Any]] = {
                eye: {"instruments": self.scene.instrument_views(sight), "poses": self._poses(sight.view)}
                for eye, sight in instant.sights.items()
            }
            yield time_ns, instant, known

    def _poses(self, view: Viewpoint) -> dict[str, Vector]:
        data, model = self.scene.data, self.scene.model
        camera_from_world = np.linalg.inv(view.pose)
        poses: dict[str, Vector] = {}
        for body in self.bodies[: self.scene.rigid_count]:
            number, pose = model.body(body.name).id, np.eye(4)
            pose[:3, :3], pose[:3, 3] = data.xmat[number].reshape(3, 3), data.xpos[number]
            poses[body.name] = camera_from_world @ pose
        return poses
