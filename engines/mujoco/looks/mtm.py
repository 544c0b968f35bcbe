"""Look of a master tool manipulator in its base frame: x to the right of the surgeon, y ahead, z up.

The axes are those of `robots.dvrk.mtm`, the pivots of the parallelogram those of `robots.dvrk.linkage`; the
shapes between them are ours, after the general appearance of the arm. Left and right are drawn alike.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from engines.mujoco.looks.part import BLACK, DARK, GREY, IVORY, STEEL, Looks, Part
from engines.mujoco.looks.solids import block, part, plate, rod, taper, union
from robots.dvrk.linkage import MTM
from robots.dvrk.mtm import chain

__all__ = ["parts"]

_ELBOW = -0.2794
"""Height of the elbow, m."""
_PIN_Y = MTM.pins[0].position[1]
"""Where crank and forearm carry the bar, m."""


@cache
def _wrist() -> tuple[float, float]:
    """Return y and z of the point where the wrist's axes meet."""
    _, y, z = chain("MTML").frames(np.zeros(7))[-1, :3, 3].tolist()
    return y, z


def parts() -> Looks:
    """Return the meshes by body."""
    return {
        "base": _base(),
        "outer_yaw": _outer_yaw(),
        "shoulder_pitch": _upper_arm(),
        "crank": _crank(),
        "bar": _bar(),
        "elbow_pitch": _forearm(),
        "wrist_platform": _platform(),
        "wrist_pitch": _wrist_pitch(),
        "wrist_yaw": _wrist_yaw(),
        "wrist_roll": _wrist_roll(),
        "gripper_left": (_handle("gripper_left", 1.0),),
        "gripper_right": (_handle("gripper_right", -1.0),),
    }


def _base() -> tuple[Part, ...]:
    """Mount under the console's housing."""
    return (part("base", rod((0.0, 0.0, 0.11), (0.0, 0.0, 0.20), 0.060), DARK),)


def _outer_yaw() -> tuple[Part, ...]:
    """Drum with the motors of shoulder and elbow on a fork."""
    drum = rod((0.0, 0.0, 0.05), (0.0, 0.0, 0.11), 0.055)
    fork = union(
        block((0.042, -0.04, -0.035), (0.056, 0.04, 0.08), 0.005),
        block((-0.056, -0.04, -0.035), (-0.042, 0.04, 0.08), 0.005),
    )
    motors = union(
        rod((0.056, 0.0, 0.0), (0.115, 0.0, 0.0), 0.030), rod((-0.115, 0.0, 0.0), (-0.056, 0.0, 0.0), 0.030)
    )
    return part("outer_yaw", union(drum, fork), IVORY), part("outer_yaw_motors", motors, DARK)


def _upper_arm() -> tuple[Part, ...]:
    """Upper arm, hanging."""
    beam = plate("x", taper(((0.0, 0.0), 0.034), ((0.0, _ELBOW), 0.024)), -0.012, 0.030, 0.004)
    axle = rod((-0.042, 0.0, 0.0), (0.042, 0.0, 0.0), 0.016)
    elbow = rod((-0.030, 0.0, _ELBOW), (0.034, 0.0, _ELBOW), 0.014)
    return part("shoulder_pitch", beam, IVORY), part("shoulder_pitch_axles", union(axle, elbow), DARK)


def _crank() -> tuple[Part, ...]:
    """Crank of the forearm's motor, with its counterweight."""
    strap = plate(
        "x", taper(((0.06, 0.0), 0.022), ((0.0, 0.0), 0.020), ((_PIN_Y, 0.0), 0.012)), -0.030, -0.018
    )
    weight = block((-0.036, 0.050, -0.026), (-0.014, 0.105, 0.026), 0.004)
    return part("crank", strap, GREY), part("crank_weight", weight, DARK)


def _bar() -> tuple[Part, ...]:
    """Bar from the crank to the forearm."""
    strap = plate("x", taper(((_PIN_Y, 0.0), 0.009), ((_PIN_Y, _ELBOW), 0.009)), -0.040, -0.032)
    pins = [rod((-0.042, _PIN_Y, z), (-0.016, _PIN_Y, z), 0.005) for z in (0.0, _ELBOW)]
    return part("bar", strap, STEEL), part("bar_pins", union(*pins), DARK)


def _forearm() -> tuple[Part, ...]:
    """Forearm to the platform's bearing."""
    y, _ = _wrist()
    beam = plate("x", taper(((0.0, _ELBOW), 0.022), ((y + 0.02, _ELBOW), 0.017)), -0.028, 0.010, 0.004)
    bearing = rod((0.0, y, _ELBOW - 0.024), (0.0, y, _ELBOW + 0.026), 0.026)
    return part("elbow_pitch", beam, IVORY), part("elbow_pitch_bearing", bearing, DARK)


def _platform() -> tuple[Part, ...]:
    """Bracket from the vertical axis out to the right and up to the axis of the wrist pitch."""
    y, z = _wrist()
    foot = plate("z", taper(((0.0, y), 0.024), ((0.095, y), 0.016)), _ELBOW + 0.026, _ELBOW + 0.042, 0.003)
    post = block((0.084, y - 0.014, _ELBOW + 0.034), (0.102, y + 0.014, z + 0.014), 0.004)
    return part("wrist_platform", union(foot, post), IVORY), part(
        "wrist_platform_bearing", rod((0.078, y, z), (0.112, y, z), 0.018), DARK
    )


def _wrist_pitch() -> tuple[Part, ...]:
    """Bracket from the pitch axis on to below the wrist, where the yaw axis stands."""
    y, z = _wrist()
    arm = block((0.066, y - 0.010, z - 0.082), (0.078, y + 0.010, z + 0.012), 0.003)
    floor = block((-0.012, y - 0.012, z - 0.086), (0.078, y + 0.012, z - 0.072), 0.003)
    bearing = rod((0.0, y, z - 0.092), (0.0, y, z - 0.060), 0.015)
    return part("wrist_pitch", union(arm, floor), GREY), part("wrist_pitch_bearing", bearing, DARK)


def _wrist_yaw() -> tuple[Part, ...]:
    """Bracket from the yaw axis ahead and up to the roll axis."""
    y, z = _wrist()
    floor = block((-0.010, y - 0.010, z - 0.060), (0.010, y + 0.072, z - 0.050), 0.002)
    post = block((-0.010, y + 0.060, z - 0.058), (0.010, y + 0.072, z + 0.012), 0.002)
    return part("wrist_yaw", union(floor, post), GREY), part(
        "wrist_yaw_motor", rod((0.0, y + 0.060, z), (0.0, y + 0.095, z), 0.014), DARK
    )


def _wrist_roll() -> tuple[Part, ...]:
    """Shaft along the roll axis, between the handles."""
    y, z = _wrist()
    shaft = rod((0.0, y - 0.006, z), (0.0, y + 0.060, z), 0.006)
    return part("wrist_roll", shaft, STEEL), part(
        "wrist_roll_end", rod((0.0, y - 0.010, z), (0.0, y + 0.004, z), 0.008), BLACK
    )


def _handle(name: str, side: float) -> Part:
    """Handle of the gripper on one side: a strap with a pad for a finger, towards the surgeon."""
    y, z = _wrist()
    x = 0.011 * side
    strap = block((min(x, 1.5 * x), y - 0.045, z - 0.008), (max(x, 1.5 * x), y + 0.004, z + 0.008), 0.002)
    pad = rod((x, y - 0.036, z), (x + 0.010 * side, y - 0.036, z), 0.011)
    return part(name, union(strap, pad), BLACK)
