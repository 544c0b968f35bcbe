"""Look of the patient's cart: column with rails for the four lifts, base on casters.

Frame: z up, y towards the patient, z = -0.1675 m at the floor. Outer dimensions: bounding box of the CAD mesh
in jhu-dvrk/dvrk_model (SUJ_cart) and height over the floor; rails: `robots.dvrk.setup_joints`.
"""

from __future__ import annotations

from engines.mujoco.looks.part import BLACK, BLUE, DARK, GREY, IVORY, SLATE, Looks, Part
from engines.mujoco.looks.solids import block, circle, outline, part, plate, rod, symmetric, union

__all__ = ["parts"]

_FLOOR = -0.1660
"""Lowest point of the cart, m."""
_TOP = 1.8007


def parts() -> Looks:
    """Return the meshes of the body `cart`."""
    return {"cart": (*_column(), *_base(), *_handle())}


def _column() -> tuple[Part, ...]:
    """Column with the rails of the lifts in front and at the sides, under a hood."""
    column = plate(
        "z",
        symmetric([(0.075, -0.42), (0.135, -0.34), (0.135, -0.21), (0.072, -0.18), (0.072, -0.030)]),
        0.06,
        1.72,
    )
    hood = plate(
        "z",
        symmetric([(0.12, -0.40), (0.145, -0.30), (0.125, -0.06), (0.08, -0.012)], 0.03),
        1.68,
        _TOP,
        0.03,
    )
    rails = [block((x - 0.008, -0.032, 0.06), (x + 0.008, -0.024, 1.70)) for x in (-0.045, 0.045)]
    sides = [
        block((x - 0.004, y - 0.008, 0.06), (x + 0.004, y + 0.008, 1.70))
        for x in (-0.074, 0.074)
        for y in (-0.146, -0.058)
    ]
    stripe = plate("z", symmetric([(0.146, -0.35), (0.147, -0.30), (0.128, -0.10)]), 1.735, 1.745)
    return (
        part("column", union(column, hood), IVORY),
        part("rails", union(*rails, *sides), DARK),
        part("stripe", stripe, BLUE),
    )


def _base() -> tuple[Part, ...]:
    """Low base with two feet to the front, a housing for the electronics behind, four casters."""
    half = [
        (0.30, -0.568),
        (0.42, -0.45),
        (0.4564, -0.10),
        (0.4564, 0.30),
        (0.40, 0.3654),
        (0.31, 0.3654),
        (0.26, 0.12),
    ]
    deck = plate("z", symmetric(half, 0.03), -0.105, 0.0)
    housing = plate("z", symmetric([(0.25, -0.53), (0.29, -0.40), (0.24, -0.10)], 0.04), -0.01, 0.30, 0.03)
    skirt = plate("z", symmetric([(0.16, -0.14), (0.13, 0.02)]), -0.01, 0.10, 0.012)
    casters = [
        rod((x - 0.022, y, _FLOOR + 0.05), (x + 0.022, y, _FLOOR + 0.05), 0.05)
        for x, y in ((-0.36, 0.28), (0.36, 0.28), (-0.30, -0.48), (0.30, -0.48))
    ]
    panel = block((-0.10, -0.535, 0.08), (0.10, -0.525, 0.24))
    return (
        part("deck", deck, GREY),
        part("housing", union(housing, skirt), IVORY),
        part("casters", union(*casters), BLACK),
        part("panel", panel, SLATE),
    )


def _handle() -> tuple[Part, ...]:
    """Bar to push the cart by."""
    arms = [
        plate(
            "x",
            outline([(-0.545, 0.955), (-0.36, 0.90), (-0.36, 0.94), (-0.545, 0.995)]),
            x - 0.012,
            x + 0.012,
        )
        for x in (-0.115, 0.115)
    ]
    grip = plate("x", circle((-0.550, 0.975), 0.018), -0.26, 0.26)
    return (part("handle", union(*arms, grip), DARK),)
