"""Look of a patient-side manipulator without its instrument, in its base frame.

The frame: x sideways, y from the mount to the patient, z up.

Seen from the side: a cradle on the mount carries the yaw link, a trough that swings in it; two pairs of bars
lead from the motor block in the trough to the column, along which the carriage with the instrument slides.
Outer dimensions: bounding boxes of the CAD meshes in WPI-AIM/dvrk_env and med-air/SurRoL (the same CAD) and
of the shapes in unina-icaros/dvrk-vrep; pivots: `robots.dvrk.linkage`; shapes between them are ours, after
the general appearance of the arm.
"""

from __future__ import annotations

from math import atan2, cos, degrees, hypot, sin

from manifold3d import Manifold

from engines.mujoco.looks.part import BLUE, DARK, GREY, IVORY, STEEL, Looks, Part
from engines.mujoco.looks.solids import (
    block,
    cannula,
    cheeks,
    circle,
    outline,
    part,
    plate,
    revolve,
    rod,
    taper,
    union,
)
from robots.dvrk.linkage import PSM

__all__ = ["parts"]

_PIVOT = {joint.name: joint.pivot[1:] for joint in PSM.joints}
_PIN = {pin.bodies: pin.position[1:] for pin in PSM.pins}
"""(y, z), m."""
_LOWER, _UPPER = _PIN["pitch_bottom", "pitch"], _PIN["pitch_top", "pitch"]
_BACK, _FRONT = _PIVOT["pitch_back"], _PIVOT["pitch_front"]
_BAR_WIDTH = 0.0475
"""Half the width of the bars, m."""
_COLUMN_WIDTH = 0.0388
"""Half the width of the column, m."""


def parts() -> Looks:
    """Return the meshes by body."""
    return {
        "base": _base(),
        "yaw": _yaw(),
        "pitch_back": _pitch_back(),
        "pitch_front": _pitch_front(),
        "pitch_bottom": _pitch_bottom(),
        "pitch_top": _pitch_top(),
        "pitch": _column(),
        "insertion": _carriage_solids(),
        "counterweight": _counterweight_solid(),
    }


def _base() -> tuple[Part, ...]:
    """Cradle: a foot on the mount, the drum of the yaw motor behind, a bearing in front.

    The foot is 0.4864 m behind the remote centre and 0.1524 m below it.
    """
    foot = plate(
        "x",
        outline(
            [
                (-0.70, -0.1524),
                (-0.37, -0.1524),
                (-0.37, -0.140),
                (-0.66, -0.140),
                (-0.68, -0.125),
                (-0.70, -0.125),
            ]
        ),
        -0.05,
        0.05,
    )
    cheek = plate(
        "y", outline([(-0.1524, -0.045), (0.0, -0.045), (0.0, 0.045), (-0.1524, 0.045)]), -0.379, -0.369
    )
    front = union(cheek, rod((0.0, -0.379, 0.0), (0.0, -0.369, 0.0), 0.045))
    stand = plate(
        "x",
        outline([(-0.766, -0.1524), (-0.684, -0.1524), (-0.684, 0.0), (-0.766, 0.0)], 0.01),
        -0.058,
        0.058,
        0.008,
    )
    drum = revolve(
        [(0.0, 0.0), (0.055, 0.0), (0.067, 0.012), (0.067, 0.096), (0.0, 0.096)],
        (0.0, -0.776, 0.0),
        (0.0, 1.0, 0.0),
    )
    cap = rod((0.0, -0.370, 0.0), (0.0, -0.3665, 0.0), 0.028)
    return (
        part("base", union(foot, front), GREY),
        part("base_drum", union(stand, drum), IVORY),
        part("base_cap", cap, DARK),
    )


def _yaw() -> tuple[Part, ...]:
    """Trough between the bearings, in whose cheeks the pivots of the back and of the front link lie."""
    section = [
        (0.012, -0.081),
        (0.012, 0.081),
        (-0.060, 0.081),
        (-0.118, 0.050),
        (-0.133, 0.020),
        (-0.133, -0.020),
        (-0.118, -0.050),
        (-0.060, -0.081),
    ]
    inside = [
        (0.05, -0.067),
        (0.05, 0.067),
        (-0.055, 0.067),
        (-0.108, 0.040),
        (-0.121, 0.015),
        (-0.121, -0.015),
        (-0.108, -0.040),
        (-0.055, -0.067),
    ]
    trough = plate("y", outline(section), -0.677, -0.381) - plate("y", outline(inside), -0.656, -0.397)
    sweep = plate(
        "x", outline([(-0.70, 0.05), (-0.70, -0.045), (-0.60, -0.045), (-0.55, 0.05)], 0.015), -0.1, 0.1
    )
    chest = plate("x", outline([(-0.37, 0.05), (-0.405, 0.05), (-0.36, -0.02)]), -0.1, 0.1)
    bearing = rod((0.0, -0.684, 0.0), (0.0, -0.655, 0.0), 0.050)
    bosses = [
        cheeks(circle(pivot, radius), 0.0800, 0.0813) for pivot, radius in ((_BACK, 0.0115), (_FRONT, 0.0095))
    ]
    return part("yaw", trough - sweep - chest, IVORY), part("yaw_bearings", union(bearing, *bosses), DARK)


def _pitch_back() -> tuple[Part, ...]:
    """Motor block below, and the fork that carries the bars.

    Drawn upright with (y, z) about the pivot, then leant back.
    """
    lean_y, lean_z = _PIVOT["pitch_bottom"][0] - _BACK[0], _PIVOT["pitch_bottom"][1] - _BACK[1]
    length, lean = hypot(lean_y, lean_z), atan2(-lean_y, lean_z)
    top_y, top_z = _PIVOT["pitch_top"][0] - _BACK[0], _PIVOT["pitch_top"][1] - _BACK[1]
    top = (cos(lean) * top_y + sin(lean) * top_z, -sin(lean) * top_y + cos(lean) * top_z)

    def leant(solid: Manifold) -> Manifold:
        return solid.rotate((degrees(lean), 0.0, 0.0)).translate((0.0, *_BACK))

    section = outline(
        [
            (-0.075, -0.095),
            (0.035, -0.095),
            (0.0504, -0.06),
            (0.0504, 0.03),
            (0.02, 0.075),
            (-0.03, 0.075),
            (-0.075, 0.02),
        ]
    )
    cover = plate("x", section, -0.0515, 0.0515, 0.007)
    fork = cheeks(taper(((-0.005, 0.05), 0.026), ((0.0, length), 0.016), (top, 0.0095)), _BAR_WIDTH, 0.0515)
    motors = [rod((x, -0.0998, z), (x, -0.06, z), 0.017) for x in (-0.029, 0.029) for z in (-0.078, -0.032)]
    below = [rod((x, -0.012, -0.110), (x, -0.012, -0.09), 0.019) for x in (-0.025, 0.025)]
    pins = [
        rod((-0.0515, *pivot), (0.0515, *pivot), radius)
        for pivot, radius in (((0.0, length), 0.007), (top, 0.0055))
    ]
    axle = rod((-0.066, 0.0, 0.0), (0.066, 0.0, 0.0), 0.010)
    return part("pitch_back", leant(union(cover, fork)), IVORY), part(
        "pitch_back_motors", leant(union(*motors, *below, axle, *pins)), DARK
    )


def _pitch_front() -> tuple[Part, ...]:
    """Narrow link on one side."""
    upper = _PIN["pitch_bottom", "pitch_front"]
    strap = plate("x", taper((_FRONT, 0.009), (upper, 0.009)), -0.0585, -0.0500)
    pins = [
        rod((-0.0600, *_FRONT), (-0.0245, *_FRONT), 0.0065),
        rod((-0.0600, *upper), (-0.0440, *upper), 0.0065),
    ]
    axle = rod((-0.067, *_FRONT), (0.067, *_FRONT), 0.0055)
    return part("pitch_front", strap, GREY), part("pitch_front_pins", union(*pins, axle), DARK)


def _pitch_bottom() -> tuple[Part, ...]:
    """Channel of the lower bars: a floor between two walls, high behind, that fork about the column."""
    (back, low), front = _PIVOT["pitch_bottom"], _LOWER[0]
    below = [
        (back - 0.008, low - 0.004),
        (back - 0.004, low - 0.008),
        (front + 0.002, low - 0.008),
        (front + 0.006, low - 0.004),
    ]
    above = [
        (front + 0.006, low + 0.006),
        (front + 0.002, low + 0.009),
        (front - 0.09, low + 0.013),
        (front - 0.24, low + 0.030),
    ]
    behind = [(back + 0.12, low + 0.050), (back + 0.03, low + 0.050), (back - 0.008, low + 0.012)]
    walls = cheeks(outline([*below, *above, *behind]), 0.0396, _BAR_WIDTH)
    floor = block((-0.0420, back + 0.012, low - 0.0080), (0.0420, front - 0.085, low - 0.003))
    pins = cheeks(circle((front, low), 0.0075), 0.0475, 0.0490)
    return part("pitch_bottom", union(walls, floor), IVORY), part("pitch_bottom_pins", pins, DARK)


def _pitch_top() -> tuple[Part, ...]:
    """Plate of the upper bars between the walls of the lower ones, forked about the column in front."""
    (back, level), front = _PIVOT["pitch_top"], _UPPER[0]
    fork = [(0.043, front - 0.090), (0.043, front + 0.006), (0.0393, front + 0.006), (0.0393, front - 0.065)]
    left, right = [(-x, y) for x, y in reversed(fork)], [(-0.0393, back - 0.008), (0.0393, back - 0.008)]
    beam = plate("z", outline([*right, *fork, *left]), level - 0.0065, level + 0.0065)
    rib = block((-0.030, back + 0.04, level + 0.006), (0.030, front - 0.09, level + 0.010))
    pins = cheeks(circle((front, level), 0.0060), 0.0430, 0.0455)
    return part("pitch_top", union(beam, rib), GREY), part("pitch_top_pins", pins, DARK)


def _column() -> tuple[Part, ...]:
    """Column behind the instrument: the rail of the carriage, and the cannula at the remote centre."""
    shape = [
        (-0.068, 0.07),
        (-0.050, 0.012),
        (-0.036, 0.012),
        (-0.032, 0.05),
        (-0.032, 0.525),
        (-0.042, 0.539),
        (-0.058, 0.539),
        (-0.068, 0.51),
    ]
    cover = plate("x", outline(shape), -_COLUMN_WIDTH, _COLUMN_WIDTH, 0.008)
    rails = [block((x - 0.004, -0.0365, 0.13), (x + 0.004, -0.0300, 0.530)) for x in (-0.014, 0.014)]
    holder = plate(
        "x",
        outline(
            [
                (-0.050, 0.014),
                (-0.036, 0.014),
                (0.002, 0.050),
                (0.002, 0.066),
                (-0.034, 0.070),
                (-0.050, 0.060),
            ]
        ),
        -0.011,
        0.011,
    )
    clamp = rod((0.0, 0.0, 0.048), (0.0, 0.0, 0.068), 0.0115)
    bosses = [cheeks(circle(pin, 0.0130), 0.0388, 0.0396) for pin in (_LOWER, _UPPER)]
    stripe = block((-0.0391, -0.060, 0.478), (0.0391, -0.046, 0.486))
    return (
        part("column", cover, IVORY),
        part("column_rail", union(*rails, *bosses, holder, clamp), DARK),
        part("column_stripe", stripe, BLUE),
        part("cannula", cannula(0.0056, 0.0105, -0.0366, 0.0860), STEEL),
    )


def _carriage_solids() -> tuple[Part, ...]:
    """Carriage at the upper end of its travel: slider, plate, and the sterile adapter of the instrument."""
    slider = block((-0.0200, -0.0360, 0.420), (0.0200, -0.0280, 0.492))
    body = plate(
        "y",
        outline([(0.4055, -0.038), (0.4975, -0.038), (0.4975, 0.038), (0.4055, 0.038)], 0.008),
        -0.0286,
        -0.0216,
    )
    adapter = block((-0.034, -0.0216, 0.408), (0.034, -0.0150, 0.501))
    return part("carriage", union(slider, body), GREY), part("sterile_adapter", adapter, IVORY)


def _counterweight_solid() -> tuple[Part, ...]:
    """Steel block of 0.179 kg (the mass of Fontanelli et al.) that runs inside the column."""
    _, y, z = next(joint.pivot for joint in PSM.joints if joint.name == "counterweight")
    return (
        part("counterweight", block((-0.0322, y - 0.011, z - 0.008), (0.0322, y + 0.011, z + 0.008)), STEEL),
    )
