"""Closed clips as cameras, page and Foxglove draw them: boxes of metal."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from engines.fem.blood.clips import ClipBody
from robots import rotation
from schemas.ros import Header, Time
from schemas.trocar_msgs import ShownMarkers
from schemas.vectors import Vector
from schemas.visualization import MarkerType

__all__ = ["clip_markers"]

_LEG_M = 0.7e-3
"""Thickness of a leg; assumed."""
_TITANIUM = (0.72, 0.73, 0.75, 1.0)


def clip_markers(bodies: Iterable[tuple[str, ClipBody]], t: int) -> ShownMarkers:
    """Return all clips, each with the name of its organ, at `t` ns: two legs and the bend between them."""
    rows = [
        (name, 3 * body.number + part, pose, scale)
        for name, body in bodies
        for part, (pose, scale) in enumerate(_boxes(body))
    ]
    count = len(rows)
    return ShownMarkers(
        header=Header(stamp=Time.from_ns(t), frame_id="world"),
        namespaces=[f"{name}/clips" for name, *_ in rows],
        ids=np.array([number for _, number, *_ in rows], np.int32),
        types=np.full(count, MarkerType.CUBE, np.uint8),
        frames=["world"] * count,
        poses=np.array([pose for *_, pose, _ in rows]).ravel(),
        scales_m=np.array([scale for *_, scale in rows]).ravel(),
        colors=np.tile(np.array(_TITANIUM, np.float32), count),
        expires_ns=np.zeros(count, np.uint64),
        texts=[""] * count,
        point_counts=np.zeros(count, np.uint32),
        color_counts=np.zeros(count, np.uint32),
    )


def _boxes(body: ClipBody) -> list[tuple[Vector, Vector]]:
    """Return poses (position, quaternion) and edges (m) of the three parts of a clip."""
    turned = rotation.from_matrix(body.axes)
    leg = np.array([body.length, body.width, _LEG_M])
    apart = body.wall + 0.5 * _LEG_M
    bend = np.array([_LEG_M, body.width, 2.0 * apart + _LEG_M])
    places = (0.0, apart), (0.0, -apart), (0.5 * (body.length - _LEG_M), 0.0)
    return [
        (
            np.concatenate([body.middle + along * body.axes[:, 0] + up * body.axes[:, 2], turned]),
            bend if along else leg,
        )
        for along, up in places
    ]
