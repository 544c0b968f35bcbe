"""The stereo endoscope: numbers of its cameras, and their frames on the endoscope camera manipulator.

Pictures are described in the optical frame of REP 103: z ahead, x to the right, y down; pixel (0, 0) is the
middle of the upper left pixel, so the middle of the picture is at ((width - 1) / 2, (height - 1) / 2).
Sources that differ, and why these were chosen: docs/decisions/0013. SI units, radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians, tan
from typing import Literal

import numpy as np

from robots.dvrk.ecm import JOINTS, Endoscope, tip
from robots.serial_chain import SerialChain
from robots.transform import translation
from schemas.vectors import Vector

__all__ = [
    "BASELINE",
    "EYES",
    "FAR",
    "FIELD_OF_VIEW",
    "HEIGHT",
    "NEAR",
    "WIDTH",
    "Eye",
    "StereoCamera",
    "left_camera",
    "optical_in_roll",
]

Eye = Literal["left", "right"]
EYES: tuple[Eye, Eye] = ("left", "right")

WIDTH, HEIGHT = 320, 288
"""Pixels of each picture (the paper of the portable dVRK simulator)."""
FIELD_OF_VIEW = radians(60.0)
"""Horizontal (unina-icaros/dvrk-vrep, vision sensors of the ECM)."""
BASELINE = 5.06e-3
"""Distance of the two cameras, m (same source: 5.00 mm sideways, 0.24 mm and 0.73 mm along the other axes).
"""
NEAR, FAR = 0.01, 2.0
"""Distances between which the cameras see, m (same source)."""

_OPTICAL_IN_VIEW = np.diag([-1.0, -1.0, 1.0, 1.0])


@dataclass(frozen=True)
class StereoCamera:
    """Two equal pinhole cameras side by side, with parallel axes and square pixels."""

    width: int = WIDTH
    height: int = HEIGHT
    field_of_view: float = FIELD_OF_VIEW
    baseline: float = BASELINE

    @property
    def focal_length(self) -> float:
        """In pixels."""
        return 0.5 * self.width / tan(0.5 * self.field_of_view)

    def intrinsics(self) -> Vector:
        """Return the camera matrix K of either camera, shape (3, 3)."""
        f = self.focal_length
        return np.array([[f, 0.0, (self.width - 1) / 2], [0.0, f, (self.height - 1) / 2], [0.0, 0.0, 1.0]])

    def projection(self, eye: Eye) -> Vector:
        """Return the matrix P, shape (3, 4), from the left camera's optical frame to pixels of `eye`."""
        shift = -self.focal_length * self.baseline if eye == "right" else 0.0
        return np.column_stack([self.intrinsics(), [shift, 0.0, 0.0]])


def optical_in_roll(endoscope: Endoscope) -> Vector:
    """Return the optical frame midway between both cameras, in the ECM's roll link, shape (4, 4).

    The left camera's frame is half the baseline along -x of it, the right one's half along x.
    """
    return tip(endoscope, "view") @ _OPTICAL_IN_VIEW


def left_camera(endoscope: Endoscope, baseline: float) -> SerialChain:
    """Return the kinematics from `ECM_base` to the left camera's optical frame (x right, y down, z ahead).

    `baseline` is the distance of the two cameras, m.
    """
    aside = translation(-0.5 * baseline, 0.0, 0.0)
    return SerialChain(JOINTS, optical_in_roll(endoscope) @ aside)
