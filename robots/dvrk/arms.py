"""The kinematics of any arm of the da Vinci Research Kit by name."""

from __future__ import annotations

from typing import get_args

from robots.dvrk import ecm, mtm, psm, setup_joints, si
from robots.dvrk.instruments import Instrument, instrument
from robots.serial_chain import SerialChain
from schemas.errors import MotionError, did_you_mean

__all__ = ["ARMS", "DEFAULT_INSTRUMENT", "base_frame", "chain"]

_CART = ("PSM1", "PSM2", "PSM3", "ECM")
ARMS = (*_CART, "MTML", "MTMR", *(f"SUJ/{arm}" for arm in _CART))
"""Names of all arms, the setup joints as on the real system."""

DEFAULT_INSTRUMENT = "LARGE_NEEDLE_DRIVER_400006"
DEFAULT_SI_INSTRUMENT = "LARGE_NEEDLE_DRIVER_420006"


def chain(
    arm: str, tool: str | Instrument | None = None, generation: si.Generation = "classic"
) -> SerialChain:
    """Return the kinematics of `arm` from `base_frame(arm)` to its tip.

        psm = chain("PSM1", "400006")
        tips = psm.forward(q)             # joints (..., 6), rad and m -> tip in PSM1_base (..., 4, 4), m

    Args:
        arm: one of `ARMS`.
        tool: name or number of the instrument of a PSM (a large needle driver 400006 unless given),
            endoscope of the ECM (straight unless given); nothing for the others.
        generation: of the da Vinci: `classic`, or `si` for arms and setup joints of the Si. Its PSM holds
            instruments of the S and Si, a large needle driver 420006 unless given.

    Raises:
        MotionError: no such arm or tool; the message lists which there are.
    """
    is_si = generation == "si"
    if arm in ("PSM1", "PSM2", "PSM3"):
        default = DEFAULT_SI_INSTRUMENT if is_si else DEFAULT_INSTRUMENT
        held = tool if isinstance(tool, Instrument) else instrument(tool or default)
        if is_si and not si.fits(held):
            raise MotionError(f"{held.name} is no instrument of the S and Si, which have numbers from 420001")
        return si.psm_chain(held) if is_si else psm.chain(held)
    if arm == "ECM":
        for endoscope in get_args(ecm.Endoscope):
            if endoscope == (tool or "straight"):
                return ecm.chain(endoscope, joints=si.ECM_JOINTS if is_si else ecm.JOINTS)
        raise MotionError(f"no endoscope '{tool}'.{did_you_mean(str(tool), get_args(ecm.Endoscope))}")
    if tool is not None:
        raise MotionError(f"arm '{arm}' holds no instrument, so it takes none")
    if arm == "MTML" or arm == "MTMR":
        return mtm.chain(arm)
    for carried in get_args(setup_joints.CartArm):
        if arm == f"SUJ/{carried}":
            return si.setup_chain(carried) if is_si else setup_joints.chain(carried)
    raise MotionError(f"no arm '{arm}'.{did_you_mean(arm, ARMS)}")


def base_frame(arm: str) -> str:
    """Return the name of the base frame of `chain(arm)`: the arm's own, the cart's for a setup joint."""
    return "cart" if arm.startswith("SUJ/") else f"{arm}_base"
