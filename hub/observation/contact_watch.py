"""Tools that enter tissue without contact, said once in a run."""

from __future__ import annotations

import logging

import numpy as np

from hub.planning.contacts import MissingContact
from schemas.vectors import Vector

__all__ = ["ContactWatch"]

log = logging.getLogger(__name__)


class ContactWatch:
    """Compares the contact spheres of a tool, by the pose of its tip, with the tissue at rest."""

    def __init__(self, missing: MissingContact) -> None:
        self._missing = missing
        nodes = missing.surface.nodes
        self._corners = nodes[missing.surface.triangles]  # (f, 3, 3)
        self._low, self._high = nodes.min(axis=0), nodes.max(axis=0)
        spheres = missing.tool.spheres
        self._spheres = spheres if len(spheres) else np.zeros((1, 3))
        self._base = missing.tool.base
        self._warned = False

    @property
    def port(self) -> tuple[str, str]:
        """Participant and output with the pose of the tip."""
        return self._missing.participant, self._missing.tool.tip

    def add(self, tip: Vector, time_ns: int) -> None:
        """Warn if a sphere's centre is in the tissue for the first time.

        `tip`: pose in the arm's base frame, shape (7,).
        """
        if self._warned:
            return
        position, axis, w = tip[:3], tip[3:6], tip[6]
        twice = 2.0 * np.cross(axis, self._spheres)
        in_base = position + self._spheres + w * twice + np.cross(axis, twice)
        centres = in_base @ self._base[:3, :3].T + self._base[:3, 3]
        near = ((centres > self._low) & (centres < self._high)).all(axis=1)
        if any(_is_inside(centre, self._corners) for centre in centres[near]):
            self._warned = True
            missing = self._missing
            log.warning(
                "at %.3g s the instrument of %s is inside '%s': there is no contact between them. %s",
                time_ns * 1e-9,
                missing.tool.name,
                missing.body,
                missing.remedy,
            )


def _is_inside(point: Vector, corners: Vector) -> bool:
    """Return whether a closed surface of triangles, shape (f, 3, 3), surrounds `point`.

    The solid angles sum to 4 pi inside and to 0 outside (Van Oosterom and Strackee 1983, IEEE Trans. Biomed.
    Eng. 30, 125).
    """
    a, b, c = np.moveaxis(corners - point, 1, 0)
    la, lb, lc = (np.linalg.norm(one, axis=1) for one in (a, b, c))
    volume = np.einsum("fi,fi->f", a, np.cross(b, c))
    edges = [np.einsum("fi,fi->f", one, other) for one, other in ((a, b), (b, c), (c, a))]
    half_angles = np.arctan2(volume, la * lb * lc + edges[0] * lc + edges[1] * la + edges[2] * lb)
    return abs(float(half_angles.sum())) > np.pi
