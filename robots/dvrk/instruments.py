"""Instruments of the PSM: joints, tip frame, and what their links weigh. SI units, radians."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians

import numpy as np

from robots.serial_chain import Joint
from schemas.vectors import Vector

__all__ = ["INSTRUMENTS", "SHAFT_RADIUS", "STEEL_DENSITY", "WRIST_RADIUS", "Instrument"]

SHAFT_RADIUS = 0.0084 / 2
"""Of the 8 mm instruments (m), as modelled in unina-icaros/dvrk-vrep."""

WRIST_RADIUS = 0.0063 / 2
"""Of the link between wrist pitch and wrist yaw (m), same source."""

STEEL_DENSITY = 7900.0
"""Stainless steel 1.4301 (AISI 304), kg/m^3 (EN 10088-1, physical properties: 7.9 kg/dm^3)."""


@dataclass(frozen=True)
class Instrument:
    """What is mounted on the arm: three joints from the shaft to the wrist, and a tip."""

    joints: tuple[Joint, Joint, Joint]
    tip: Vector
    """Pose of the tip frame in the frame of the last link, shape (4, 4)."""
    roll_mass: float
    """Mass of the link that rolls, kg."""
    pitch_mass: float
    """Mass of the link between wrist pitch and wrist yaw, kg."""


_WRIST_VELOCITY = radians(1080.0)
"""rad/s, of roll and wrist (jhu-dvrk/sawIntuitiveResearchKit, core/components/code/mtsIntuitiveResearchKitPSM.cpp)."""

_LARGE_NEEDLE_DRIVER_JOINTS = (
    Joint("roll", "revolute", 0.0, 0.0, 0.4162, 0.0, -4.53786, 4.53786, _WRIST_VELOCITY, 0.33),
    Joint("wrist_pitch", "revolute", -pi / 2, 0.0, 0.0, -pi / 2, -1.39626, 1.39626, _WRIST_VELOCITY, 0.25),
    Joint("wrist_yaw", "revolute", -pi / 2, 0.0091, 0.0, -pi / 2, -1.39626, 1.39626, _WRIST_VELOCITY, 0.20),
)
"""jhu-dvrk/sawIntuitiveResearchKit, share/tool/LARGE_NEEDLE_DRIVER_400006.json."""

_TOOLTIP_OFFSET = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""Same file: turns the last link so that the tip's z axis points out of the instrument."""

INSTRUMENTS = {
    "palpation-probe": Instrument(_LARGE_NEEDLE_DRIVER_JOINTS, _TOOLTIP_OFFSET, roll_mass=3.428938e-4, pitch_mass=2.491212e-4),
}
"""By the name that a scenario uses. The palpation probe is a steel sphere centred on the tip frame in place of the jaws of a
large needle driver 400006; link masses of that tool from CAD (WPI-AIM/dvrk_env, tool_lnd.urdf.xacro)."""
