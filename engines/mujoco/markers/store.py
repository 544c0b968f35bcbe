"""Which markers are shown: what messages add, change and delete, and what expires.

It knows neither MuJoCo nor a clock. The state is the message `ShownMarkers` itself, so one thing is drawn,
recorded, hashed and saved.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.markers.checks import check, orientation
from engines.mujoco.markers.stl import stl_triangles
from robots import rotation
from schemas.errors import MessageError
from schemas.ros import Header, Time
from schemas.trocar_msgs import ShownMarkers
from schemas.vectors import Vector
from schemas.visualization import MOST_MARKERS, ColorRGBA, Marker, MarkerAction, MarkerArray, MarkerType

__all__ = ["MOST_POINTS", "MarkerStore", "ShownMarker", "shown_markers"]

MOST_POINTS = 20_000
"""Points and letters of all markers together."""
_WORLD = "world"
_CLIPS = "/clips"
"""End of the namespace of an organ's clips."""
_SHOWN_LETTERS = 40
"""Letters of a namespace shown in a reason."""

S = TypeVar("S", bound=np.generic)

PoseOf = Callable[[str], Vector]
"""Returns the pose of a frame in the world now, shape (4, 4)."""


@dataclass(frozen=True, slots=True)
class ShownMarker:
    """A marker as it is shown."""

    type: MarkerType
    frame: str
    pose: Vector
    """Pose in the frame, shape (7,)."""
    scale: Vector
    """Shape (3,), m; a number of a mesh."""
    color: NDArray[np.float32]
    """Shape (4,)."""
    expires_ns: int
    text: str
    points: Vector
    """Shape (n, 3), m, in the marker's own frame."""
    colors: NDArray[np.float32]
    """Shape (n, 4) or (n / 3, 4), or (0, 4)."""
    is_metal: bool = False
    """Whether it is a clip of an engine of tissue, not a sign for people."""

    @property
    def weight(self) -> int:
        """Number of points and letters."""
        return len(self.points) + len(self.text)


class MarkerStore:
    """The markers of a scene."""

    def __init__(self, frames: Collection[str], fixed: Collection[str], objects: Collection[str]) -> None:
        """Start with none.

        Args:
            frames: that the scene has.
            fixed: those of them that never move.
            objects: whose shapes a mesh may be.
        """
        self._frames, self._fixed, self._objects = frames, fixed, objects
        self._markers: dict[tuple[str, int], ShownMarker] = {}
        self._weight, self._next_ns, self._changed_ns = 0, 0, 0
        self._shown: ShownMarkers | None = None

    @property
    def shown(self) -> ShownMarkers:
        """All markers now; the same message until something changes."""
        if self._shown is None:
            self._shown = _pack_markers(self._markers, Time.from_ns(self._changed_ns))
        return self._shown

    def apply(self, message: MarkerArray, t_ns: int, pose_of: PoseOf) -> list[str]:
        """Do what a message says at simulated time `t_ns`; return why markers of it were rejected.

        What is rejected changes nothing; all others of the message are shown.
        """
        reasons: list[str] = []
        for marker in message.markers:
            try:
                self._apply_action(marker, t_ns, pose_of)
            except MessageError as error:
                reasons.append(f"marker '{marker.ns[:_SHOWN_LETTERS]}' {marker.id}: {error}")
        if len(reasons) < len(message.markers):
            self._note_change(t_ns)
        return reasons

    def _apply_action(self, marker: Marker, t_ns: int, pose_of: PoseOf) -> None:
        if marker.action == MarkerAction.DELETEALL:
            for key in [key for key in self._markers if marker.ns in ("", key[0])]:
                self._remove_marker(key)
        elif marker.action == MarkerAction.DELETE:
            if (marker.ns, marker.id) in self._markers:
                self._remove_marker((marker.ns, marker.id))
        elif marker.action == MarkerAction.ADD:
            self._add((marker.ns, marker.id), self._shown_marker(marker, t_ns, pose_of))
        else:
            raise MessageError(
                f"action {marker.action}; allowed are 0 (add or modify), 2 (delete), 3 (delete all)"
            )

    def _add(self, key: tuple[str, int], made: ShownMarker) -> None:
        before = self._markers.get(key)
        weight = self._weight + made.weight - (before.weight if before is not None else 0)
        if before is None and len(self._markers) >= MOST_MARKERS:
            raise MessageError(
                f"{MOST_MARKERS} markers are shown, and no more are allowed: delete some first"
            )
        if weight > MOST_POINTS:
            raise MessageError(
                f"{weight} points and letters in all; allowed are {MOST_POINTS}: delete some first"
            )
        self._markers[key] = made
        self._weight = weight

    def _remove_marker(self, key: tuple[str, int]) -> None:
        self._weight -= self._markers.pop(key).weight

    def _shown_marker(self, marker: Marker, t_ns: int, pose_of: PoseOf) -> ShownMarker:
        kind, points = marker.type, _points(marker)
        check(marker, points, self._frames, self._objects)
        if kind == MarkerType.MESH_RESOURCE and len(points):
            kind = MarkerType.TRIANGLE_LIST
        frame, position = marker.header.frame_id, marker.pose.position
        pose = np.array([position.x, position.y, position.z, *orientation(marker.pose.orientation)])
        if not marker.frame_locked and frame not in self._fixed:
            frame, pose = _WORLD, _pose_in_world(pose_of(frame), pose)
        lifetime = marker.lifetime.ns
        is_text = kind == MarkerType.TEXT_VIEW_FACING
        return ShownMarker(
            type=MarkerType(kind),
            frame=frame,
            pose=pose,
            scale=np.array([marker.scale.x, marker.scale.y, marker.scale.z]),
            color=_rgba_rows([marker.color])[0],
            expires_ns=t_ns + lifetime if lifetime else 0,
            text=marker.text if is_text else marker.mesh_resource if kind == MarkerType.MESH_RESOURCE else "",
            points=points,
            colors=_rgba_rows(marker.colors),
        )

    def expire(self, t_ns: int) -> None:
        """Remove what has reached the end of its lifetime at simulated time `t_ns`."""
        if self._next_ns and t_ns >= self._next_ns:
            for key in [key for key, one in self._markers.items() if 0 < one.expires_ns <= t_ns]:
                self._remove_marker(key)
            self._note_change(t_ns)

    def _note_change(self, t_ns: int) -> None:
        self._next_ns = min((one.expires_ns for one in self._markers.values() if one.expires_ns), default=0)
        self._changed_ns, self._shown = t_ns, None

    def restore(self, shown: ShownMarkers) -> None:
        """Show what a message of before says."""
        keys = zip(shown.namespaces, shown.ids.tolist(), strict=True)
        self._markers = dict(zip(keys, shown_markers(shown), strict=True))
        self._weight = sum(one.weight for one in self._markers.values())
        self._note_change(shown.header.stamp.ns)


def _points(marker: Marker) -> Vector:
    if marker.type == MarkerType.MESH_RESOURCE and marker.mesh_file.data.size:
        return stl_triangles(marker.mesh_file.data)
    return np.array([[point.x, point.y, point.z] for point in marker.points]).reshape(-1, 3)


def _rgba_rows(colors: list[ColorRGBA]) -> NDArray[np.float32]:
    return np.array([[c.r, c.g, c.b, c.a] for c in colors], np.float32).reshape(-1, 4)


def _pose_in_world(frame: Vector, pose: Vector) -> Vector:
    """Return a pose in `frame`, shape (7,), in the world, where `frame` has a pose of shape (4, 4)."""
    turned = rotation.product(rotation.from_matrix(frame), pose[3:])
    return np.concatenate([frame[:3, :3] @ pose[:3] + frame[:3, 3], turned / np.linalg.norm(turned)])


def _pack_markers(markers: dict[tuple[str, int], ShownMarker], stamp: Time) -> ShownMarkers:
    each = list(markers.values())

    def joined(name: str, dtype: type[S]) -> NDArray[S]:
        parts = [cast("NDArray[S]", getattr(one, name)).ravel() for one in each]
        return np.concatenate(parts) if parts else np.zeros(0, dtype)

    return ShownMarkers.model_construct(
        header=Header(stamp=stamp, frame_id=_WORLD),
        namespaces=[ns for ns, _ in markers],
        ids=np.array([number for _, number in markers], np.int32),
        types=np.array([one.type for one in each], np.uint8),
        frames=[one.frame for one in each],
        poses=joined("pose", np.float64),
        scales_m=joined("scale", np.float64),
        colors=joined("color", np.float32),
        expires_ns=np.array([one.expires_ns for one in each], np.uint64),
        texts=[one.text for one in each],
        point_counts=np.array([len(one.points) for one in each], np.uint32),
        points_m=joined("points", np.float64),
        color_counts=np.array([len(one.colors) for one in each], np.uint32),
        point_colors=joined("colors", np.float32),
    )


def shown_markers(shown: ShownMarkers) -> Iterator[ShownMarker]:
    """Yield the markers of a message. Raises MessageError if its parts do not fit together."""
    try:
        n, m, k = len(shown.types), int(shown.point_counts.sum()), int(shown.color_counts.sum())
        poses, scales = shown.poses.reshape(n, 7), shown.scales_m.reshape(n, 3)
        colors, points = shown.colors.reshape(n, 4), shown.points_m.reshape(m, 3)
        of_points = shown.point_colors.reshape(k, 4)
        rows = zip(
            map(MarkerType, shown.types.tolist()),
            shown.frames,
            poses,
            scales,
            colors,
            shown.expires_ns.tolist(),
            shown.texts,
            np.split(points, np.cumsum(shown.point_counts[:-1].astype(np.int64))) if n else (),
            np.split(of_points, np.cumsum(shown.color_counts[:-1].astype(np.int64))) if n else (),
            (name.endswith(_CLIPS) for name in shown.namespaces),
            strict=True,
        )
        made = [ShownMarker(*row) for row in rows]
    except ValueError as error:
        raise MessageError(f"{ShownMarkers.ros_type}: its parts do not fit together ({error})") from error
    yield from made
