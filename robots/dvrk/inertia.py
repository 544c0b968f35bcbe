"""Masses, centres and inertia tensors of the bodies of PSM, ECM and instruments.

PSM: the bodies of the arm are fitted so that the arm has the identified dynamics (`robots.dvrk.identified`)
with an instrument mounted; `bench/identified_inertia.py` makes the numbers in `data/psm_inertia.json`. ECM:
masses and centres from CAD, not identified; dvrk_env = WPI-AIM/dvrk_env (commit 675a3fa),
dvrk_description/ecm/ecm.urdf.xacro. See docs/decisions/0010.

SI units. All bodies of an arm stand in its base frame (origin in the remote centre of motion) with every
joint at 0, insertion included.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from math import pi
from types import MappingProxyType

import numpy as np

from robots.dvrk.contact_spheres import FINGER_HALF_WIDTH
from robots.dvrk.ecm import chain as ecm_chain
from robots.dvrk.hand import Hand
from robots.dvrk.instruments import SHAFT_RADIUS, STEEL_DENSITY, WRIST_RADIUS, Instrument
from robots.dvrk.psm import chain as psm_chain
from robots.dvrk.rolling_needle_driver import PADS
from schemas.vectors import Vector

__all__ = ["ENDOSCOPE_MASS", "PROBE_RADIUS", "SHAFT_MASS", "Inertia", "ecm", "instrument", "psm"]


@dataclass(frozen=True)
class Inertia:
    """Mass (kg), centre of mass (m), shape (3,), inertia tensor about the centre (kg m^2), shape (3, 3)."""

    mass: float
    centre: Vector
    tensor: Vector

    @classmethod
    def of_box(cls, mass: float, centre: Vector, size: Vector) -> Inertia:
        """Return that of a uniform box of `size` (m), shape (3,), parallel to the axes."""
        return cls(mass, centre, mass / 12.0 * np.diag(size @ size - size * size))

    @classmethod
    def of_rod(cls, mass: float, start: Vector, end: Vector, radius: float) -> Inertia:
        """Return that of a thin tube from `start` to `end` (m), shape (3,).

        Where these are one point it is that of a ring without direction.
        """
        along = np.outer(end - start, end - start)
        length_squared = np.trace(along)
        axis = along / (length_squared or 1.0)
        across = mass * (length_squared / 12.0 + radius**2 / 2.0)
        return cls(mass, (start + end) / 2.0, across * (np.eye(3) - axis) + mass * radius**2 * axis)

    @property
    def pseudo_inertia(self) -> Vector:
        """Integral of r r^T over the mass, r = (x, y, z, 1), shape (4, 4).

        It is positive definite if and only if a body can have this inertia.
        """
        result = np.empty((4, 4))
        result[:3, :3] = (
            np.trace(self.tensor) / 2.0 * np.eye(3)
            - self.tensor
            + self.mass * np.outer(self.centre, self.centre)
        )
        result[:3, 3] = result[3, :3] = self.mass * self.centre
        result[3, 3] = self.mass
        return result


SHAFT_MASS = 0.0117201
"""kg of an instrument's shaft, as modelled in unina-icaros/dvrk-vrep (body L1_respondable_TOOL1)."""
_YAW_LINK_MASS = 6.63661e-6
"""kg of what turns with the wrist yaw beside the fingers (dvrk_env tool_lnd.urdf.xacro, CAD of the large
needle driver, for all).
"""
_FINGER_MASS = 3.90696e-5
"""kg of one finger (same file)."""

PROBE_RADIUS = 5e-3
"""m, of the sphere of a palpation probe unless the scene states another one."""

ENDOSCOPE_MASS: Mapping[str, float] = MappingProxyType(
    {"Classic_SD": 1.5, "Classic_HD": 2.5, "Si_HD": 1.8, "Custom": 0.8, "none": 0.1}
)
"""kg, with its camera head (jhu-dvrk/sawIntuitiveResearchKit, mtsIntuitiveResearchKitEndoscopeTypes.cdg)."""
_ENDOSCOPE_CENTRE = -0.1
"""Of an endoscope along the insertion axis in the frame of the insertion link, m (same project,
share/kinematic/ECM.json, cz).
"""
_ENDOSCOPE_LENGTH, _ENDOSCOPE_RADIUS = 0.603, 0.035
"""m, with camera head: bounds of ECM_tool.stl (jhu-dvrk/dvrk_model)."""


def psm(tool: Instrument, probe_radius: float = PROBE_RADIUS) -> Mapping[str, Inertia]:
    """Return the bodies of a PSM with `tool` by link; the instrument's housing is part of the insertion."""
    return {**_arm_of_psm(), **instrument(tool, probe_radius)}


@cache
def _arm_of_psm() -> Mapping[str, Inertia]:
    data = json.loads(files("robots.dvrk").joinpath("data/psm_inertia.json").read_text(encoding="utf-8"))
    return {
        name: Inertia(row["mass"], np.array(row["centre"]), np.array(row["tensor"]))
        for name, row in data["bodies"].items()
    }


def instrument(tool: Instrument, probe_radius: float = PROBE_RADIUS) -> Mapping[str, Inertia]:
    """Return the moving bodies of an instrument by link.

    They are shaft, wrist, and fingers (closed) or probe; or shaft and phalanges (straight).
    """
    chain = psm_chain(tool)
    frames = chain.frames(np.zeros(len(chain.joints)))
    origins, ahead = frames[:-1, :3, 3], frames[-1, :3, 2]  # (n, 3), (3,)
    first = len(chain.joints) - len(tool.joints)
    bodies = {
        "roll": Inertia.of_rod(tool.roll_mass + SHAFT_MASS, origins[first - 1], origins[first], SHAFT_RADIUS)
    }
    for i in range(first + 1, len(chain.joints) - 1):
        bodies[chain.joints[i].name] = Inertia.of_rod(
            tool.pitch_mass, origins[i], origins[i + 1], WRIST_RADIUS
        )
    if tool.hand is not None:
        return {**bodies, **_hand(tool.hand, frames[-2])}
    last, end = chain.joints[-1].name, origins[-1]
    if tool.jaw is None:
        mass = STEEL_DENSITY * 4.0 / 3.0 * pi * probe_radius**3
        return {**bodies, last: Inertia(mass, end, 0.4 * mass * probe_radius**2 * np.eye(3))}
    bodies[last] = Inertia(_YAW_LINK_MASS, end, 0.4 * _YAW_LINK_MASS * WRIST_RADIUS**2 * np.eye(3))
    finger = Inertia.of_rod(_FINGER_MASS, end, end + tool.jaw.length * ahead, FINGER_HALF_WIDTH)
    return {**bodies, "jaw_left": finger, "jaw_right": finger, **_pads(tool, end, ahead, frames[-2, :3, 2])}


def _pads(tool: Instrument, end: Vector, ahead: Vector, axis: Vector) -> Mapping[str, Inertia]:
    """Return the pads of a roller, of steel.

    The wrist yaw axis passes `end` along `axis`, which like `ahead` is one of the base frame's, shape (3,).
    """
    if tool.roller is None:
        return {}
    along, across, thickness = tool.roller.size
    side = np.cross(axis, ahead)  # of the left finger
    size = np.abs(along * ahead + across * axis + thickness * side)
    middle = end + tool.roller.distance * ahead
    return {
        pad: Inertia.of_box(
            STEEL_DENSITY * along * across * thickness, middle + way * thickness / 2.0 * side, size
        )
        for pad, way in zip(PADS, (1.0, -1.0), strict=True)
    }


def _hand(hand: Hand, shaft: Vector) -> Mapping[str, Inertia]:
    """Return the phalanges of `hand`, its frame being `shaft`, shape (4, 4)."""
    bodies: dict[str, Inertia] = {}
    for link, mass in zip(hand.links, np.tile(hand.masses, len(hand.fingers)).tolist(), strict=True):
        pose = shaft @ link.pose
        bodies[link.name] = Inertia.of_rod(
            mass, pose[:3, 3], pose[:3, 3] + link.phalanx.length * pose[:3, 0], hand.radius
        )
    return bodies


_ECM_CAD = {
    "yaw": (6.4168, (0.0, -0.4327, -0.0290), (0.176, 0.267, 0.170)),
    "pitch": (2.0321, (-0.0008, -0.0849, 0.3141), (0.051, 0.129, 0.577)),
    "insertion": (0.23108, (-0.0008, -0.0524, 0.4209), (0.054, 0.033, 0.118)),
    "pitch_front": (1.6069, (0.0, -0.3710, 0.1358), (0.101, 0.253, 0.365)),
    "pitch_back": (0.4214, (0.0081, -0.4098, 0.1402), (0.030, 0.123, 0.307)),
    "pitch_bottom": (0.35928, (0.0, -0.2975, 0.3135), (0.050, 0.408, 0.074)),
    "pitch_top": (0.43851, (0.0, -0.2787, 0.3242), (0.012, 0.358, 0.018)),
}
"""By link: mass, centre (dvrk_env, CAD, carried from the link's frame to the base frame), and the size of its
mesh (jhu-dvrk/dvrk_model, bounds): the tensors that the CAD exports are zero or no body's, so a uniform box
of that size stands in.
"""


def ecm(endoscope_mass: float = ENDOSCOPE_MASS["Classic_SD"]) -> Mapping[str, Inertia]:
    """Return the bodies of the ECM by link, with an endoscope of this mass (kg) on the roll."""
    bodies = {
        name: Inertia.of_box(mass, np.array(centre), np.array(size))
        for name, (mass, centre, size) in _ECM_CAD.items()
    }
    carriage = ecm_chain().frames(np.zeros(4))[2]  # (4, 4)
    middle = carriage[:3, 3] + _ENDOSCOPE_CENTRE * carriage[:3, 2]
    half = _ENDOSCOPE_LENGTH / 2.0 * carriage[:3, 2]
    bodies["roll"] = Inertia.of_rod(endoscope_mass, middle - half, middle + half, _ENDOSCOPE_RADIUS)
    return bodies
