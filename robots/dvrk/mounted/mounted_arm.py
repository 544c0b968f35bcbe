"""An arm in a scenario: base pose and dynamics."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from robots import rotation
from robots.dvrk.drive import Disc, Drive
from robots.dvrk.end_effectors.contact_sphere import ContactSphere
from robots.dvrk.end_effectors.end_effector import EndEffector, Mount
from robots.dvrk.inertia import Inertia
from robots.dvrk.link import Link
from robots.dvrk.own_dynamics import JAW, OwnDynamics
from robots.dvrk.parameters import UnitQuaternion
from robots.serial_chain import SerialChain
from robots.transform import rigid_transform
from schemas.errors import MotionError
from schemas.files import find_file
from schemas.quantity import Length
from schemas.vectors import Vector

__all__ = ["MountedArm", "Published"]

Published = tuple[Mapping[str, Inertia], Mapping[str, Drive], tuple[Disc, ...]]
"""Bodies, drives and discs."""


class MountedArm(BaseModel):
    """An arm: base pose, unless setup joints carry the arm."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    position: tuple[Length, Length, Length] = Field(
        default=(0.0, 0.0, 0.0), description="of the remote centre of motion in the world"
    )
    orientation: UnitQuaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0),
        description="of the arm's base frame in the world: quaternion x, y, z, w",
    )
    dynamics: Path | None = Field(
        default=None,
        description="file of `trocar identify`: masses, friction, springs of your own arm; null: published",
    )

    @property
    def pose(self) -> Vector:
        """Pose of the base frame in the world, shape (4, 4), unless setup joints carry the arm."""
        return rigid_transform(rotation.matrix(np.array(self.orientation)), self.position)

    @cached_property
    @abstractmethod
    def chain(self) -> SerialChain:
        """The arm's kinematics."""

    @property
    def end_effector(self) -> EndEffector:
        """End effector of the arm's tool; without joints for an endoscope."""
        return EndEffector()

    @property
    def end_effector_start(self) -> tuple[float, ...]:
        """Positions of the end effector's joints at time 0."""
        return ()

    @cached_property
    def end_effector_links(self) -> tuple[Link, ...]:
        """Moving links of the end effector, parents before children."""
        return self.end_effector.links(Mount.on(self.chain))

    @property
    def spheres(self) -> tuple[ContactSphere, ...]:
        """Contact spheres for tissue."""
        return ()

    @property
    def variants(self) -> tuple[Self, ...]:
        """The arm as mounted, then with each spare instrument."""
        return (self,)

    def by_owner(self, arm: str) -> Mapping[str, Self]:
        """Return the variants of `arm` by the prefix of names in a model: `PSM1`, `PSM1/<spare>`."""
        return {arm: self}

    @property
    def commanded_end_effector(self) -> EndEffector:
        """End effector with the commanded joints: the instrument's, else the first spare's that has some."""
        return next((one.end_effector for one in self.variants if one.end_effector.joints), self.end_effector)

    @property
    @abstractmethod
    def _published(self) -> Published: ...

    @property
    def _driven(self) -> list[str]:
        """Joints allowed in a file of `dynamics`; the last, a jaw, may be missing."""
        return [joint.name for joint in self.chain.joints]

    @field_validator("dynamics")
    @classmethod
    def _find(cls, file: Path | None, info: ValidationInfo) -> Path | None:
        return None if file is None else find_file(file, info)

    @model_validator(mode="after")
    def _has_these_dynamics(self) -> Self:
        if (own := self._own) is None:
            return self
        joints, discs = self._driven, len(self._published[2])
        if list(own.joints) not in (joints, [name for name in joints if name != JAW]) or (
            len(own.discs) != discs
        ):
            raise ValueError(
                f"dynamics: '{self.dynamics}' was identified with {own.instrument}, of joints"
                f" {', '.join(own.joints)} and {len(own.discs)} discs; this arm has"
                f" {', '.join(joints)} and {discs}: identify it with what it holds here"
            )
        return self

    @cached_property
    def _own(self) -> OwnDynamics | None:
        try:
            return None if self.dynamics is None else OwnDynamics.load(self.dynamics)
        except MotionError as error:
            raise ValueError(f"dynamics: {error}") from error

    @cached_property
    def bodies(self) -> Mapping[str, Inertia]:
        """Inertia of the bodies by link, tool included."""
        published = self._published[0]
        return published if self._own is None else self._own.bodies_of(published)

    @cached_property
    def drives(self) -> Mapping[str, Drive]:
        """Drives by joint, and by motor of the end effector."""
        published = self._published[1]
        return published if self._own is None else self._own.drives_of(published)

    @cached_property
    def discs(self) -> tuple[Disc, ...]:
        """The discs of an instrument."""
        published = self._published[2]
        return published if self._own is None else self._own.discs_of(published)
