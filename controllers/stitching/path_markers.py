"""Markers of a picked stitch in the endoscope's pictures: points, path, plane and a banner.

Colours as in `controllers.vrep_sutures`: blue where the needle goes in, red where it comes out. SI units,
in the world.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from controllers.stitching.geometry import Stitch
from controllers.stitching.plan import BEFORE
from robots import rotation
from robots.dvrk.crtk import WORLD_FRAME
from schemas.ros import Header, Point, Pose, Quaternion, Vector3
from schemas.vectors import Vector
from schemas.visualization import ColorRGBA, Marker, MarkerAction, MarkerType

__all__ = ["banner_marker", "path_markers", "point_marker"]

_NAMESPACE = "stitch"
_BLUE, _RED = ColorRGBA(b=1.0, a=1.0), ColorRGBA(r=1.0, a=1.0)
_PATH, _PANE = ColorRGBA(r=0.1, g=0.9, b=0.2, a=1.0), ColorRGBA(r=0.2, g=0.8, b=1.0, a=0.35)
_WORDS = ColorRGBA(r=1.0, g=0.9, b=0.2, a=1.0)
_POINT, _LINE, _THICKNESS, _LETTERS = 2.0e-3, 0.6e-3, 0.2e-3, 3.0e-3
"""m; of a point, of the path, of the disc, and of the banner: our choice."""
_LONGEST = 48
"""Letters of a line of the banner: the width of the picture."""
_LINES = 24
"""Lines of the path."""


def point_marker(number: int, place: Vector | None) -> Marker:
    """Return the entry (0) or the exit (1) at `place`, shape (3,), or a deletion."""
    if place is None:
        return _create_marker(("entry", "exit")[number], action=MarkerAction.DELETE)
    x, y, z = place.tolist()
    return _create_marker(
        ("entry", "exit")[number],
        type=MarkerType.SPHERE,
        pose=Pose(position=Point(x=x, y=y, z=z)),
        scale=Vector3(x=_POINT, y=_POINT, z=_POINT),
        color=(_BLUE, _RED)[number],
    )


def path_markers(stitch: Stitch | None, emerge: float) -> Iterator[Marker]:
    """Yield the way of the tip until the take-over and the needle's plane, or their deletion."""
    if stitch is None:
        yield from (_create_marker(name, action=MarkerAction.DELETE) for name in ("path", "disc"))
        return
    tip = np.append(stitch.needle.marks[2], 1.0)
    way = [
        (stitch.pose(float(angle)) @ tip)[:3].tolist()
        for angle in np.linspace(stitch.entry - BEFORE, stitch.exit + emerge, _LINES + 1)
    ]
    yield _create_marker(
        "path",
        type=MarkerType.LINE_STRIP,
        scale=Vector3(x=_LINE),
        color=_PATH,
        points=[Point(x=x, y=y, z=z) for x, y, z in way],
    )
    x, y, z = stitch.centre.tolist()
    i, j, k, w = rotation.from_matrix(stitch.axes).tolist()
    across = 2.0 * stitch.needle.radius
    yield _create_marker(
        "disc",
        type=MarkerType.CYLINDER,
        pose=Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=i, y=j, z=k, w=w)),
        scale=Vector3(x=across, y=across, z=_THICKNESS),
        color=_PANE,
    )


def banner_marker(text: str, camera: str, place: tuple[float, float, float]) -> Marker:
    """Return the words in the picture, at `place` in the left camera's optical frame."""
    x, y, z = place
    return _create_marker(
        "banner",
        frame=f"{camera}_left_optical",
        type=MarkerType.TEXT_VIEW_FACING,
        pose=Pose(position=Point(x=x, y=y, z=z)),
        scale=Vector3(z=_LETTERS),
        color=_WORDS,
        text=text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}...",
    )


def _create_marker(name: str, frame: str = WORLD_FRAME, **fields: object) -> Marker:
    return Marker.model_validate(
        {"header": Header(frame_id=frame), "ns": f"{_NAMESPACE}/{name}", "frame_locked": True} | fields
    )
