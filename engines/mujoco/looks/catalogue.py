"""Looks and collision shapes of all parts of the robot, by name."""

from __future__ import annotations

from functools import cache
from typing import get_args

from engines.mujoco.looks import cart, collision_shapes, console, ecm, instruments, mtm, psm, setup_joints
from engines.mujoco.looks.part import Collisions, Looks
from robots.dvrk.instruments import Instrument, instrument
from robots.dvrk.setup_joints import CartArm
from schemas.errors import MotionError

__all__ = ["collision", "parts"]

_INSTRUMENT = "instrument/"


@cache
def parts(what: str | Instrument) -> Looks:
    """Return the meshes of `what` by body, drawn with every joint at 0.

    Args:
        what: `psm` and `ecm` (in the arm's base frame `<arm>_base`; the PSM without instrument, the ECM with
        endoscope),
            `instrument/<name or number>` (in the PSM's base frame), `cart` and `suj/<arm>` (in the cart's
            frame); or an instrument of the user's own.

    Raises:
        MotionError: no such instrument, or nothing of this name.
    """
    if isinstance(what, Instrument):
        return instruments.parts(what)
    if what.startswith(_INSTRUMENT):
        return instruments.parts(instrument(what.removeprefix(_INSTRUMENT)))
    for arm in get_args(CartArm):
        if what == f"suj/{arm}":
            return setup_joints.parts(arm)
    simple = {
        "psm": psm.parts,
        "ecm": ecm.parts,
        "cart": cart.parts,
        "mtm": mtm.parts,
        "console": console.parts,
    }
    if what not in simple:
        raise _nothing(what)
    return simple[what]()


@cache
def collision(what: str | Instrument) -> Collisions:
    """Return the collision shapes of `what` by body, in the frames of `parts`; masters and console have none.

    Raises:
        MotionError: no such instrument, or nothing of this name.
    """
    if isinstance(what, Instrument):
        return collision_shapes.instrument(what)
    if what.startswith(_INSTRUMENT):
        return collision_shapes.instrument(instrument(what.removeprefix(_INSTRUMENT)))
    for arm in get_args(CartArm):
        if what == f"suj/{arm}":
            return collision_shapes.setup_joint(arm)
    if what in ("mtm", "console"):
        return {}
    simple = {"psm": collision_shapes.psm, "ecm": collision_shapes.ecm, "cart": collision_shapes.cart}
    if what not in simple:
        raise _nothing(what)
    return simple[what]()


def _nothing(what: str) -> MotionError:
    return MotionError(
        f"no look of '{what}': there are psm, ecm, mtm, cart, console, suj/<arm> and instrument/<name or"
        " number>"
    )
