"""The simulated arms of a scene, as devices know them."""

from __future__ import annotations

from collections.abc import Mapping

from hub.participant import Params
from robots.dvrk.mounted.mounted_arms import AnyArm
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from robots.dvrk.mounted.mounted_mtm import MountedMtml, MountedMtmr
from robots.dvrk.mounted.mounted_psm import MountedPsm
from robots.dvrk.setup_joints import CartArm, DrivenArm

__all__ = ["SceneArms"]


class SceneArms(Params):
    """Arms of cart and console, by name."""

    PSM1: MountedPsm | None = None
    PSM2: MountedPsm | None = None
    PSM3: MountedPsm | None = None
    ECM: MountedEcm | None = None
    MTML: MountedMtml | None = None
    MTMR: MountedMtmr | None = None

    @property
    def present_arms(self) -> Mapping[CartArm, MountedPsm | MountedEcm]:
        """The arms of the cart."""
        named: dict[CartArm, MountedPsm | MountedEcm | None] = {
            "PSM1": self.PSM1,
            "PSM2": self.PSM2,
            "PSM3": self.PSM3,
            "ECM": self.ECM,
        }
        return {name: arm for name, arm in named.items() if arm is not None}

    @property
    def driven_arms(self) -> Mapping[DrivenArm, AnyArm]:
        """The arms of the cart, and the masters."""
        named: dict[DrivenArm, AnyArm | None] = {"MTML": self.MTML, "MTMR": self.MTMR}
        return {**self.present_arms, **{name: arm for name, arm in named.items() if arm is not None}}
