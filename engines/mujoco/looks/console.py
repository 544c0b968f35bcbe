"""Look of the surgeon's console: housing with stereo viewer, armrest and pedals.

Its frame stands between the bases of the masters (`robots.dvrk.mtm.BASE`): x to the right of the surgeon, y
ahead, z up. The viewer's place is that of the dVRK's numbers; shapes and sizes are ours.
"""

from __future__ import annotations

from engines.mujoco.looks.part import BLACK, BLUE, DARK, GREY, IVORY, Looks, Part
from engines.mujoco.looks.solids import block, part, place_solid, plate, rod, symmetric, union
from robots.dvrk.mtm import BASE
from robots.transform import inverse_transform

__all__ = ["parts"]

_FLOOR = -0.905
"""Height of the floor under a viewer that stands as by default, m."""
_VIEWER = inverse_transform(0.5 * (BASE["MTML"] + BASE["MTMR"]))
"""Pose of the stereo viewer in this frame, shape (4, 4)."""


def parts() -> Looks:
    """Return the meshes of the body `console`."""
    return {"console": (*_housing(), *_viewer(), *_stand(), *_armrest(), *_pedals())}


def _housing() -> tuple[Part, ...]:
    """Housing above the masters."""
    top = plate(
        "z", symmetric([(0.30, -0.40), (0.46, -0.10), (0.46, 0.22), (0.30, 0.30)], 0.04), 0.20, 0.46, 0.04
    )
    stripe = plate("z", symmetric([(0.304, -0.406), (0.465, -0.10), (0.465, 0.0)]), 0.30, 0.315)
    return part("console_housing", top, IVORY), part("console_stripe", stripe, BLUE)


def _viewer() -> tuple[Part, ...]:
    """Hood with two eyepieces, tilted as the picture is."""
    hood = block((-0.17, -0.10, 0.03), (0.17, 0.12, 0.26), 0.03)
    eyes = [rod((x, 0.0, 0.0), (x, 0.0, 0.05), 0.026) for x in (-0.032, 0.032)]
    turn, place = _VIEWER[:3, :3], _VIEWER[:3, 3]
    rest = block((-0.14, 0.10, -0.01), (0.14, 0.125, 0.10), 0.01)
    return part("console_hood", place_solid(hood, turn, place), GREY), part(
        "console_eyepieces", place_solid(union(*eyes, rest), turn, place), BLACK
    )


def _stand() -> tuple[Part, ...]:
    """Two columns on feet behind the masters."""
    columns = [block((x - 0.05, 0.14, _FLOOR + 0.05), (x + 0.05, 0.27, 0.24), 0.015) for x in (-0.40, 0.40)]
    feet = [block((x - 0.06, -0.45, _FLOOR), (x + 0.06, 0.40, _FLOOR + 0.09), 0.015) for x in (-0.40, 0.40)]
    beam = block((-0.40, 0.17, _FLOOR + 0.10), (0.40, 0.24, _FLOOR + 0.30), 0.01)
    return part("console_columns", union(*columns, beam), IVORY), part("console_feet", union(*feet), DARK)


def _armrest() -> tuple[Part, ...]:
    """Bar for the forearms, on two arms from the columns."""
    bar = block((-0.44, -0.66, -0.33), (0.44, -0.56, -0.28), 0.015)
    arms = [block((x - 0.02, -0.60, -0.36), (x + 0.02, 0.20, -0.30), 0.005) for x in (-0.42, 0.42)]
    return part("console_armrest", bar, BLACK), part("console_armrest_arms", union(*arms), GREY)


def _pedals() -> tuple[Part, ...]:
    """Tray with pedals: clutch and camera to the left, coagulation to the right."""
    tray = block((-0.34, -0.36, _FLOOR), (0.34, -0.02, _FLOOR + 0.03), 0.005)
    pedals = [
        block((x - 0.05, -0.30, _FLOOR + 0.03), (x + 0.05, -0.12, _FLOOR + 0.055), 0.006)
        for x in (-0.24, -0.10, 0.10, 0.24)
    ]
    return part("console_tray", tray, DARK), part("console_pedals", union(*pedals), GREY)
