"""The terms of a contract: all names, units and frames, for the arms of a scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

from robots.dvrk.crtk import Mounting, reference_frame
from robots.dvrk.mounted.mounted_arm import MountedArm
from robots.policies.actions import ACTIONS
from robots.policies.contract import CameraContract, Contract
from robots.policies.fields import Field, Group
from robots.policies.states import state_groups
from schemas.errors import ScenarioError

__all__ = ["Terms"]


@dataclass(frozen=True)
class Terms:
    """A contract with the names of all numbers."""

    contract: Contract
    state_groups: tuple[Group, ...]
    action_groups: tuple[Group, ...]

    @classmethod
    def of(cls, contract: Contract, arms: Mapping[Any, MountedArm], mounting: Mounting) -> Terms:
        """Return the terms for the arms of a scene.

        Raises ScenarioError if the scene has no such arm.
        """
        if missing := [arm for arm in contract.arms if arm not in arms]:
            raise ScenarioError(
                f"contract: {', '.join(missing)} is no arm of the scene", path=("scene", "contract")
            )
        frames = {arm: reference_frame(arm, arms, mounting, contract.frame) for arm in contract.arms}
        joints = {arm: arms[arm].chain.joints for arm in contract.arms}
        layout = ACTIONS[contract.action]
        return cls(
            contract,
            tuple(
                group
                for arm in contract.arms
                for group in state_groups(contract.state, arm, frames[arm], joints[arm])
            ),
            tuple(group for arm in contract.arms for group in layout.groups(arm, frames[arm], joints[arm])),
        )

    @property
    def state_fields(self) -> tuple[Field, ...]:
        """Numbers of the state."""
        return tuple(field for group in self.state_groups for field in group.fields)

    @property
    def action_fields(self) -> tuple[Field, ...]:
        """Numbers of a row of actions."""
        return tuple(field for group in self.action_groups for field in group.fields)

    @property
    def width(self) -> int:
        """Count of numbers in a row of actions."""
        return len(self.action_fields)

    @property
    def horizon(self) -> int:
        """Most rows in an answer."""
        return self.contract.horizon

    @property
    def action(self) -> str:
        """Name of the action layout."""
        return self.contract.action

    @property
    def cameras(self) -> Mapping[str, CameraContract]:
        """Cameras by name."""
        return self.contract.cameras

    def describe(self) -> dict[str, Any]:
        """Return the terms as JSON for the other side."""
        return {
            "arms": list(self.contract.arms),
            "state": [str(field) for field in self.state_fields],
            "action": [str(field) for field in self.action_fields],
            "action_layout": self.contract.action,
            "rate": self.contract.rate,
            "horizon": self.contract.horizon,
            "cameras": {
                name: [camera.height, camera.width, 3] for name, camera in self.contract.cameras.items()
            },
            "instruction": self.contract.instruction,
        }

    def misfits(self, stated: Mapping[str, Any]) -> list[str]:
        """Return where a policy's own statement differs: `describe` of its side, or a part of it.

        A statement may name layouts and sizes only: `{"action_layout": "joint", "horizon": 16}`.
        """
        ours = self.describe()
        found = [
            f"'{key}' is no entry of a contract, which has {', '.join(ours)}"
            for key in stated
            if key not in ours
        ]
        found += [
            f"{key}: the policy has {_plain(stated[key])!r}, the contract {ours[key]!r}"
            for key in ("arms", "action_layout", "rate", "horizon")
            if key in stated and _plain(stated[key]) != ours[key]
        ]
        for key in ("state", "action"):
            if key in stated:
                found += _name_misfits(key, ours[key], _plain(stated[key]))
        if "cameras" in stated:
            found += _camera_misfits(ours["cameras"], stated["cameras"])
        return found


def _plain(value: Any) -> Any:
    """Return tuples as lists, as JSON has them."""
    return [_plain(part) for part in cast("list[Any]", value)] if isinstance(value, list | tuple) else value


def _name_misfits(key: str, ours: list[str], stated: Any) -> list[str]:
    """Return the differences of names; a bare count is compared as a count."""
    if isinstance(stated, int):
        return (
            []
            if stated == len(ours)
            else [f"{key}: the policy has {stated} numbers, the contract {len(ours)}"]
        )
    if not isinstance(stated, list):
        return [f"{key}: the policy states {stated!r}, expected a list of names or their count"]
    names = [str(name) for name in cast("list[Any]", stated)]
    if len(names) != len(ours):
        return [f"{key}: the policy has {len(names)} numbers, the contract {len(ours)}"]
    return [
        f"{key}[{i}]: the policy has '{name}', the contract '{own}'"
        for i, (name, own) in enumerate(zip(names, ours, strict=True))
        if name not in (own, own.split(" ")[0])
    ]


def _camera_misfits(ours: Mapping[str, list[int]], stated: Any) -> list[str]:
    if not isinstance(stated, Mapping):
        return [f"cameras: the policy states {stated!r}, expected sizes by name"]
    sizes = {str(name): _plain(size) for name, size in cast("Mapping[Any, Any]", stated).items()}
    missing = [
        f"cameras: the policy needs '{name}', the contract has none" for name in sizes if name not in ours
    ]
    return missing + [
        f"cameras: the policy has '{name}' as {sizes[name]}, the contract as {size}"
        for name, size in ours.items()
        if name in sizes and sizes[name] != size
    ]
