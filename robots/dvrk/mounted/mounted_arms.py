"""The arms of cart and console in a scenario, by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ConfigDict, with_config
from typing_extensions import TypedDict  # pydantic needs this one before Python 3.12

from robots.dvrk.mounted.mounted_ecm import MountedEcm
from robots.dvrk.mounted.mounted_mtm import MountedMtm, MountedMtml, MountedMtmr
from robots.dvrk.mounted.mounted_psm import MountedPsm

__all__ = ["AnyArm", "MountedArms", "require_classic_cart"]

AnyArm = MountedPsm | MountedEcm | MountedMtm
"""Any simulated arm."""


def require_classic_cart(arms: Mapping[Any, object]) -> None:
    """Raise ValueError, as validators do, for an arm of the Si on the cart."""
    other = [name for name, one in arms.items() if getattr(one, "generation", "classic") == "si"]
    if other:
        raise ValueError(
            f"{', '.join(other)}: the cart is that of the Classic; set 'mounting: free' and place an arm of"
            " the Si by position and orientation"
        )


@with_config(ConfigDict(extra="forbid"))
class MountedArms(TypedDict, total=False):
    """The arms of cart and console by name, for validation."""

    PSM1: MountedPsm
    PSM2: MountedPsm
    PSM3: MountedPsm
    ECM: MountedEcm
    MTML: MountedMtml
    MTMR: MountedMtmr
