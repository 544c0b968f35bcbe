"""The target of the authors' visual servoing: four white discs on a red box. Numbers with their sources, SI.

The frame is in the middle of the discs' plane, x along the longer side of the box, z up.

Source: unina-icaros/dvrk-vrep (commit 88fe597), dVRK-visualservoing.ttt; order of the points and their wanted
features from its V-REP_catkin_ws/src (commit 65ef3cc), node tracker_blobs_ibvs_real.
"""

from __future__ import annotations

__all__ = ["BOX", "DISCS", "DISC_HEIGHT", "DISC_RADIUS", "GOAL", "Corners"]

BOX = (0.140, 0.100, 0.040)
"""Along x, y and z, m."""
DISC_RADIUS, DISC_HEIGHT = 12.5e-3, 0.6e-3
"""Radius of the discs, and height of the discs over the box, m."""


Corners = tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]
"""Corners of the quadrangle of the discs: x and y, in order along the outline."""

DISCS: Corners = ((-0.03, -0.02), (-0.03, 0.02), (0.03, 0.02), (0.03, -0.02))
"""Centres of the discs, m."""
GOAL: Corners = ((-0.1784, -0.1163), (-0.1997, 0.1208), (0.2147, 0.1211), (0.1922, -0.1160))
"""Where the discs should be in the picture, normalised (x right, y down)."""
