"""A hollow tube of a label map in a scenario: wall, lumen, and joints of its ends to organs."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.label_mesh import LabelMesh
from engines.tissue.organs.label_tube import LabelTube
from engines.tissue.organs.params import OrganParams
from engines.tissue.organs.shape import ROUNDING_DIGITS
from engines.tissue.organs.touching import nearest_places
from schemas.vectors import Vector

__all__ = ["PatientTube", "TubeJoint", "make_tube"]

_NODES = 240
_BILE = re.compile(r"duct|bil|chol|gall")
_LUMENS: Mapping[bool, Mapping[str, Any]] = {
    True: {"liquid": "bile", "pressure": "10 mmHg"},
    False: {"liquid": "blood"},
}
_WALL = {"young_modulus": "60 kPa", "poisson_ratio": 0.45, "inertia": 25}
"""Wall of a duct, and inertia for sub-steps of 0.1 ms (docs/decisions/0149-patients.md)."""
_TOUCHING, _WITHIN = 1.5, 0.25
"""Distance of an end's middle from the organ that it joins: voxels, and a share of the radius more."""
_SPARE = 1.2
_STEP = 5e-4
"""Distance of the places of a surface to which ends are drawn, m."""
_THICKEST = 0.45
"""Largest wall over the least diameter."""


@dataclass(frozen=True)
class TubeJoint:
    """An end of a tube on an organ."""

    organ: str
    end: str
    """`left` or `right`."""
    within: float
    """Distance up to which nodes of the end are tied, m."""


@dataclass(frozen=True)
class PatientTube:
    """A tube, ready for a scenario."""

    name: str
    params: dict[str, Any]
    """The organ of the scenario."""
    mesh: TetMesh
    joints: tuple[TubeJoint, ...]
    report: list[str]


def make_tube(tube: LabelTube, wall: float, organs: Sequence[LabelMesh]) -> PatientTube:
    """Return a tube with a wall (m), drawn onto the organs at its ends; an end at none is held.

    Raises ValueError for a wall that leaves no lumen.
    """
    path, diameters = tube.path, tube.diameters
    if wall > _THICKEST * diameters.min():
        raise ValueError(
            f"{tube.body.name}: a wall of {1e3 * wall:g} mm leaves no lumen where the tube is"
            f" {1e3 * diameters.min():.2g} mm wide: {1e3 * _THICKEST * diameters.min():.2g} mm at most"
        )
    found = [_organ_at(path[i], diameters[i], organs) for i in (0, -1)]
    if found[0] is None and found[1] is not None:  # the left end is at the organ
        path, diameters, found = path[::-1], diameters[::-1], found[::-1]
    path = path.copy()
    for i, other in zip((0, -1), found, strict=True):
        if other is not None:
            path[i] = nearest_places(path[[i]], other.mesh, _STEP)[0]
    ends: dict[str, LabelMesh | None] = dict(zip(("left", "right"), found, strict=True))
    params = {
        "tube": {
            "path": np.round(path, ROUNDING_DIGITS).tolist(),
            "diameters": np.round(diameters, ROUNDING_DIGITS).tolist(),
            "wall": wall,
        },
        "nodes": _NODES,
        **_WALL,
        "anchors": [{"surface": end} for end, other in ends.items() if other is None],
        "lumen": dict(_LUMENS[_BILE.search(tube.body.name) is not None]),
    }
    organ = OrganParams.model_validate(params)
    joints: list[TubeJoint] = []
    for end, other in ends.items():
        if other is not None:
            nodes = np.unique(organ.local.triangles)
            ring = organ.local.nodes[nodes[organ.body.surface(end, organ.local.nodes[nodes])]]
            reach = float(np.linalg.norm(ring - nearest_places(ring, other.mesh, _STEP), axis=1).max())
            joints.append(TubeJoint(other.body.name, end, _SPARE * reach + 1e-4))
    return PatientTube(tube.body.name, params, organ.local, tuple(joints), _sentences(tube, ends))


def _organ_at(place: Vector, diameter: float, organs: Sequence[LabelMesh]) -> LabelMesh | None:
    """Return the organ that touches an end; None: none does."""
    depths = {
        i: float(organ.body.field(place[None])[0])
        + 0.5 * _WITHIN * diameter
        + _TOUCHING * organ.body.field.spacing
        for i, organ in enumerate(organs)
    }
    best = max(depths, key=lambda i: depths[i], default=None)
    return None if best is None or depths[best] < 0.0 else organs[best]


def _sentences(tube: LabelTube, ends: Mapping[str, LabelMesh | None]) -> list[str]:
    low, high = 1e3 * float(tube.diameters.min()), 1e3 * float(tube.diameters.max())
    length = 1e3 * float(np.linalg.norm(np.diff(tube.path, axis=0), axis=1).sum())
    where = [f"{end} at {other.body.name if other else 'no organ: held'}" for end, other in ends.items()]
    return [
        *tube.body.changes,
        f"a tube, {length:.3g} mm long, {low:.2g} to {high:.2g} mm wide; {', '.join(where)}",
    ]
