"""Look of the endoscope camera manipulator with its endoscope, in its base frame.

The frame: x sideways, y from the mount to the patient, z up. Like the PSM, but the front link drives and
holds the motors, and the camera's head hangs on the column. Outer dimensions: bounding boxes of the CAD
meshes in jhu-dvrk/dvrk_model (Classic ECM) and of its endoscope; pivots: `robots.dvrk.linkage`; shapes
between them are ours, after the general appearance of the arm.
"""

from __future__ import annotations

from engines.mujoco.looks.part import BLACK, BLUE, DARK, GREY, IVORY, SLATE, STEEL, Looks, Part
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
from robots.dvrk.linkage import ECM

__all__ = ["parts"]

_PIVOT = {joint.name: joint.pivot[1:] for joint in ECM.joints}
_PIN = {pin.bodies: pin.position[1:] for pin in ECM.pins}
"""(y, z), m."""
_LOWER, _UPPER = _PIN["pitch_bottom", "pitch"], _PIN["pitch_top", "pitch"]
_BACK, _FRONT = _PIVOT["pitch_back"], _PIVOT["pitch_front"]


def parts() -> Looks:
    """Return the meshes by body."""
    return {
        "base": _base(),
        "yaw": _yaw(),
        "pitch_front": _pitch_front(),
        "pitch_back": _pitch_back(),
        "pitch_bottom": _pitch_bottom(),
        "pitch_top": _pitch_top(),
        "pitch": _column(),
        "insertion": _carriage_solids(),
        "roll": _endoscope_solids(),
    }


def _base() -> tuple[Part, ...]:
    """Drum of the yaw motor on the mount, 0.6126 m behind the remote centre and 0.1016 m below it."""
    drum = revolve(
        [(0.0, 0.0), (0.046, 0.0), (0.0586, 0.014), (0.0586, 0.142), (0.0, 0.142)],
        (0.0, -0.695, 0.0),
        (0.0, 1.0, 0.0),
    )
    section = outline(
        [
            (-0.094, -0.0786),
            (-0.03, -0.0786),
            (0.03, -0.055),
            (0.03, 0.055),
            (-0.03, 0.0786),
            (-0.094, 0.0786),
        ]
    )
    foot = rod((0.0, -0.6126, -0.1016), (0.0, -0.6126, -0.090), 0.055)
    bearing = rod((0.0, -0.5535, 0.0), (0.0, -0.5394, 0.0), 0.052)
    return part("base", union(drum, plate("y", section, -0.685, -0.553, 0.006)), IVORY), part(
        "base_bearing", union(foot, bearing), DARK
    )


def _yaw() -> tuple[Part, ...]:
    """Fork that swings about the yaw axis; the motors' link stands between its cheeks."""
    section = outline(
        [(-0.095, -0.070), (0.045, -0.070), (0.062, -0.045), (0.062, 0.045), (0.045, 0.070), (-0.095, 0.070)]
    )
    cheek = outline(
        [
            (-0.47, -0.101),
            (-0.30, -0.085),
            (-0.2715, -0.04),
            (-0.2715, 0.025),
            (-0.315, 0.069),
            (-0.40, 0.069),
            (-0.47, 0.040),
        ]
    )
    floor = block((-0.075, -0.50, -0.100), (0.075, -0.31, -0.086))
    pivots = cheeks(circle(_FRONT, 0.026), 0.080, 0.0905)
    fork = union(plate("y", section, -0.5384, -0.455, 0.010), cheeks(cheek, 0.060, 0.088, 0.006), floor)
    return part("yaw", fork, IVORY), part("yaw_pivots", pivots, DARK)


def _pitch_front() -> tuple[Part, ...]:
    """Link with the motors at its foot; its two cheeks carry the bars."""
    low, top, y = _PIVOT["pitch_bottom"], _PIVOT["pitch_top"], _FRONT[0]
    foot = [
        (y - 0.05, -0.030),
        (y + 0.06, -0.030),
        (y + 0.090, 0.0),
        (y + 0.090, 0.085),
        (y + 0.050, 0.125),
        (y - 0.03, 0.125),
        (y - 0.07, 0.06),
    ]
    back = [
        (low[0] - 0.0596, 0.20),
        (low[0] - 0.01, 0.185),
        (low[0] + 0.012, 0.25),
        (low[0] - 0.02, 0.26),
        (low[0] - 0.0596, 0.25),
    ]
    motors, cover = (
        plate("x", outline(foot), -0.0505, 0.0505, 0.007),
        plate("x", outline(back), -0.030, 0.030),
    )
    straps = cheeks(taper(((y - 0.02, 0.08), 0.040), (low, 0.018), (top, 0.0107)), 0.0300, 0.0505)
    cooler = [
        block((-0.044, y + 0.005 + step, 0.115), (0.044, y + 0.010 + step, 0.140))
        for step in (-0.03, -0.015, 0.0, 0.015, 0.03)
    ]
    axle = rod((-0.079, *_FRONT), (0.079, *_FRONT), 0.022)
    pins = [
        rod((-0.0515, *pivot), (0.0515, *pivot), radius) for pivot, radius in ((low, 0.010), (top, 0.0065))
    ]
    return part("pitch_front", union(motors, cover, straps), IVORY), part(
        "pitch_front_motors", union(*cooler, axle, *pins), DARK
    )


def _pitch_back() -> tuple[Part, ...]:
    """Guide of the lower bar, on one side."""
    upper = _PIN["pitch_bottom", "pitch_back"]
    strap = plate("x", taper((_BACK, 0.010), (upper, 0.0099)), 0.0255, 0.0295)
    pins = [rod((-0.006, *point), (0.0295, *point), 0.007) for point in (_BACK, upper)]
    return part("pitch_back", union(strap, *pins), DARK), part(
        "pitch_back_axle", rod((-0.062, *_BACK), (0.062, *_BACK), 0.006), STEEL
    )


def _pitch_bottom() -> tuple[Part, ...]:
    """Lower bar."""
    (back, low), front = _PIVOT["pitch_bottom"], _LOWER[0]
    below = [
        (back - 0.055, low - 0.018),
        (front - 0.05, low - 0.0188),
        (front + 0.0125, low - 0.012),
        (front + 0.0125, low + 0.012),
    ]
    beam = outline(
        [*below, (front - 0.05, low + 0.017), (back - 0.03, low + 0.017), (back - 0.055, low + 0.005)]
    )
    boss = outline(
        [
            (back - 0.045, low),
            (back + 0.02, low),
            (back + 0.02, low + 0.024),
            (back - 0.02, low + 0.055),
            (back - 0.045, low + 0.055),
        ]
    )
    return (
        part(
            "pitch_bottom",
            union(plate("x", beam, -0.0248, 0.0248, 0.004), plate("x", boss, 0.012, 0.0248)),
            DARK,
        ),
    )


def _pitch_top() -> tuple[Part, ...]:
    """Upper bar, a thin rod."""
    back, front = _PIVOT["pitch_top"], _UPPER
    strap = plate("x", taper((back, 0.009), (front, 0.009)), -0.0068, 0.0052)
    return (part("pitch_top", strap, GREY),)


def _column() -> tuple[Part, ...]:
    """Column behind the endoscope, with the rail of the carriage and the cannula."""
    shape = [
        (-0.116, 0.10),
        (-0.095, 0.0),
        (-0.066, 0.0),
        (-0.062, 0.04),
        (-0.062, 0.555),
        (-0.075, 0.570),
        (-0.100, 0.570),
        (-0.116, 0.54),
    ]
    cover = plate("x", outline(shape), -0.0255, 0.0255, 0.006)
    rails = [block((x - 0.004, -0.0640, 0.10), (x + 0.004, -0.0590, 0.545)) for x in (-0.014, 0.014)]
    bosses = [cheeks(circle(pin, 0.0115), 0.0250, 0.0262) for pin in (_LOWER, _UPPER)]
    holder = plate(
        "x",
        outline(
            [
                (-0.085, 0.004),
                (-0.066, 0.004),
                (0.004, 0.046),
                (0.004, 0.062),
                (-0.064, 0.062),
                (-0.085, 0.05),
            ]
        ),
        -0.011,
        0.011,
    )
    clamp = rod((0.0, 0.0, 0.044), (0.0, 0.0, 0.064), 0.0127)
    stripe = block((-0.0258, -0.108, 0.50), (0.0258, -0.092, 0.508))
    return (
        part("column", cover, IVORY),
        part("column_rail", union(*rails, *bosses, holder, clamp), DARK),
        part("column_stripe", stripe, BLUE),
        part("cannula", cannula(0.0075, 0.0120, -0.006, 0.080), STEEL),
    )


def _carriage_solids() -> tuple[Part, ...]:
    """Carriage at the upper end of its way."""
    body = plate(
        "z", outline([(-0.028, -0.061), (0.026, -0.061), (0.026, -0.034), (-0.028, -0.034)]), 0.3729, 0.4909
    )
    return (part("carriage", union(body, rod((0.0, -0.036, 0.43), (0.0, -0.028, 0.43), 0.020)), GREY),)


def _endoscope_solids() -> tuple[Part, ...]:
    """Endoscope along the z axis: 12 mm shaft, sterile adapter, camera head with two light cables.

    Its tip is just below the remote centre.
    """
    shaft = rod((0.0, 0.0, -0.0002), (0.0, 0.0, 0.335), 0.006)
    lens = rod((0.0, 0.0, -0.0007), (0.0, 0.0, -0.0002), 0.0054)
    adapter = revolve(
        [
            (0.0, 0.330),
            (0.0100, 0.330),
            (0.0175, 0.347),
            (0.0175, 0.372),
            (0.0300, 0.380),
            (0.0300, 0.440),
            (0.0, 0.440),
        ]
    )
    collar = revolve([(0.0, 0.440), (0.0330, 0.440), (0.0330, 0.487), (0.0270, 0.495), (0.0, 0.495)])
    head = plate(
        "z",
        outline([(-0.035, -0.0403), (0.035, -0.0403), (0.035, 0.0387), (-0.035, 0.0387)], 0.012),
        0.495,
        0.590,
        0.008,
    )
    cables = [rod((x, 0.008, 0.585), (x, 0.008, 0.612), 0.009) for x in (-0.016, 0.016)]
    band = plate(
        "z",
        outline([(-0.0354, -0.0406), (0.0354, -0.0406), (0.0354, 0.0391), (-0.0354, 0.0391)], 0.012),
        0.520,
        0.526,
    )
    return (
        part("endoscope_shaft", shaft, STEEL),
        part("endoscope_black", union(lens, collar, *cables), BLACK),
        part("endoscope_adapter", adapter, SLATE),
        part("camera_head", head, IVORY),
        part("camera_band", band, BLUE),
    )
