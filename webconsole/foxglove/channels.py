"""Foxglove's topics of a session: the outputs as published, and the page's drawing as a scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import foxglove
import numpy as np
from foxglove.messages import (
    Color,
    FrameTransform,
    FrameTransforms,
    Point3,
    Quaternion,
    SceneEntity,
    SceneUpdate,
    Timestamp,
    TriangleListPrimitive,
    Vector3,
)
from numpy.typing import NDArray

from hub.participant.view import TISSUE_COLOURS, Scene, wet_colours
from schemas.codec import decode, ros2msg_definition
from schemas.soft_surface import FILM_STEP_M, FaceKind, SoftSurface, film_steps
from schemas.trocar_msgs import SoftBodyState, SurfaceChange, SurfaceFilm
from schemas.vectors import Vector
from webconsole.source import Outlet, Source, Value
from webconsole.stage import Stage

__all__ = ["Channel", "channels_of"]

WORLD = "world"
Newest = Callable[[str], Value | None]


class Channel:
    """A topic, made of `outlets`.

    Args:
        topic: Name of the topic.
        outlets: Names of the outlets, as in `Source.newest`.
        schema: Schema of the messages.
        encoding: Encoding of the messages.
        context: Context of the server.
    """

    def __init__(
        self,
        topic: str,
        outlets: Sequence[str],
        schema: foxglove.Schema,
        encoding: str,
        context: foxglove.Context,
    ) -> None:
        self.topic, self.outlets = topic, frozenset(outlets)
        self._channel = foxglove.Channel(topic, schema=schema, message_encoding=encoding, context=context)
        self._sent: dict[str, Value] | None = None

    @property
    def has_subscribers(self) -> bool:
        """Whether a client subscribes."""
        return self._channel.has_sinks()

    def put(self, newest: Newest) -> None:
        """Send new values, if a client subscribes; raises MessageError if a value is not valid."""
        if not self.has_subscribers:
            self._sent = None
            return
        values = {name: value for name in sorted(self.outlets) if (value := newest(name))}
        if values == self._sent:
            return
        for payload in self._messages(values):
            self._channel.log(payload, log_time=max((one.time_ns for one in values.values()), default=0))
        self._sent = values

    def _messages(self, values: dict[str, Value]) -> Iterator[bytes]:
        """Yield the messages of new values: here as published."""
        return (value.payload for value in values.values())

    def again(self) -> None:
        """Send the present values once more: somebody has only now subscribed."""
        self._sent = None

    def close(self) -> None:
        """Offer the topic no longer."""
        self._channel.close()


class _Bodies(Channel):
    """Where the bodies of a scene are."""

    def __init__(self, stage: Stage, participant: str, context: foxglove.Context) -> None:
        outlets = stage.inputs(participant)
        super().__init__(f"/{participant}/tf", outlets, FrameTransforms.get_schema(), "protobuf", context)
        self._stage, self._participant = stage, participant

    def _messages(self, values: dict[str, Value]) -> Iterator[bytes]:
        if not self.outlets <= values.keys():
            return
        at = _stamp(max(value.time_ns for value in values.values()))
        names = self._stage.scenes[self._participant].bodies
        poses = self._stage.poses(self._participant, values).tolist()
        yield FrameTransforms(
            transforms=[
                FrameTransform(
                    timestamp=at,
                    parent_frame_id=WORLD,
                    child_frame_id=f"{self._participant}/{name}",
                    translation=Vector3(x=x, y=y, z=z),
                    rotation=Quaternion(x=qx, y=qy, z=qz, w=qw),
                )
                for name, (x, y, z, qx, qy, qz, qw) in zip(names, poses, strict=True)
            ]
        ).encode()


class _Shapes(Channel):
    """The meshes of a scene's bodies, in their frames."""

    def __init__(self, participant: str, scene: Scene, context: foxglove.Context) -> None:
        super().__init__(f"/{participant}/scene", (), SceneUpdate.get_schema(), "protobuf", context)
        self._participant, self._scene = participant, scene

    def _messages(self, values: dict[str, Value]) -> Iterator[bytes]:  # noqa: ARG002  # they never change
        for number, part in enumerate(self._scene.parts):
            shape = _triangles(part.vertices, part.faces, part.colour)
            frame = f"{self._participant}/{self._scene.bodies[part.body]}"
            yield _scene_entity(f"{self._participant}/{number}", frame, [shape], 0)


class _Surface(Channel):
    """A soft surface, in the world."""

    def __init__(self, stage: Stage, name: str, source: Source, context: foxglove.Context) -> None:
        topic = f"/{name.replace('.', '/')}/surface"
        change = stage.changes.get(name)
        film = stage.films.get(name)
        outlets = tuple(one for one in (name, change, film) if one is not None)
        super().__init__(topic, outlets, SceneUpdate.get_schema(), "protobuf", context)
        self._name, self._change, self._film, self._source = name, change, film, source
        self._colours = {FaceKind.OUTSIDE: stage.surfaces[name], **TISSUE_COLOURS}

    def _messages(self, values: dict[str, Value]) -> Iterator[bytes]:
        first, value = self._source.first(self._name), values.get(self._name)
        if first is None or value is None:
            return
        nodes = decode(SoftBodyState, value.payload).nodes_m.reshape(-1, 3)
        start = decode(SoftBodyState, first.payload)
        if not start.triangles.size:
            return
        surface = SoftSurface.of_first(start)
        if change := values.get(self._change or ""):
            surface = surface.changed(decode(SurfaceChange, change.payload))
        film = decode(SurfaceFilm, wet.payload) if (wet := values.get(self._film or "")) else None
        steps = None if film is None or not film.nodes.size else film_steps(film, len(nodes))
        liquid = "" if film is None else film.liquid
        shapes = [
            _triangles(
                nodes,
                faces,
                (*colour, 1.0),
                None
                if steps is None
                else wet_colours(colour, FILM_STEP_M * steps.astype(np.float64), liquid),
            )
            for kind, colour in self._colours.items()
            if len(faces := surface.of_kind(kind))
        ]
        if surface.faces.max() < len(nodes):
            yield _scene_entity(self._name, WORLD, shapes, value.time_ns)


def channels_of(
    stage: Stage, outlets: Sequence[Outlet], source: Source, context: foxglove.Context
) -> list[Channel]:
    """Return the topics of a session."""
    made = [
        Channel(
            f"/{one.name.replace('.', '/', 1)}",
            (one.name,),
            foxglove.Schema(
                name=one.port.type, encoding="ros2msg", data=ros2msg_definition(one.port.type).encode()
            ),
            "cdr",
            context,
        )
        for one in outlets
        if one.live
    ]
    for participant, scene in stage.scenes.items():
        made += [_Shapes(participant, scene, context), _Bodies(stage, participant, context)]
    return made + [_Surface(stage, name, source, context) for name in stage.surfaces]


def _stamp(time_ns: int) -> Timestamp:
    return Timestamp(*divmod(time_ns, 10**9))


def _scene_entity(name: str, frame: str, shapes: list[TriangleListPrimitive], time_ns: int) -> bytes:
    made = SceneEntity(
        timestamp=_stamp(time_ns), frame_id=frame, id=name, frame_locked=True, triangles=shapes
    )
    return SceneUpdate(entities=[made]).encode()


def _triangles(
    vertices: NDArray[np.float32],
    faces: NDArray[np.uint32] | NDArray[np.int32],
    colour: tuple[float, float, float, float],
    colours: Vector | None = None,
) -> TriangleListPrimitive:
    """Return triangles of one colour, or with `colours` of the vertices, shape (n, 3)."""
    red, green, blue, opacity = colour
    of_vertices = () if colours is None else colours.tolist()
    return TriangleListPrimitive(
        points=[Point3(x=x, y=y, z=z) for x, y, z in vertices.tolist()],
        indices=faces.ravel().tolist(),
        color=Color(r=red, g=green, b=blue, a=opacity),
        colors=[Color(r=r, g=g, b=b, a=1.0) for r, g, b in of_vertices],
    )
