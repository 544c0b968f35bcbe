"""A patient-side manipulator in a scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Self

import numpy as np
from pydantic import Field, model_validator

from robots.dvrk import arm_bodies, drives
from robots.dvrk.end_effectors.electrode import Electrode
from robots.dvrk.end_effectors.end_effector import Mount
from robots.dvrk.end_effectors.jaw import Jaw
from robots.dvrk.end_effectors.probe import PROBE_RADIUS, Probe
from robots.dvrk.end_effectors.scissors import Scissors
from robots.dvrk.end_effectors.suction_tube import SuctionTube
from robots.dvrk.instruments import Instrument, instrument
from robots.dvrk.mounted.mounted_arm import MountedArm, Published
from robots.dvrk.mounted.psm_tool import PsmTool
from robots.dvrk.own_dynamics import JAW
from robots.dvrk.parameters import FOLDED, HandPositions, InstrumentName
from robots.transform import inverse_transform
from schemas.errors import MotionError
from schemas.quantity import Length
from schemas.scenario import Name
from schemas.vectors import Vector

__all__ = ["MountedPsm"]

_WRISTED = 3
"""Joints of an instrument with roll, wrist pitch and wrist yaw."""
_EXCHANGED = (Jaw, Scissors, Electrode, SuctionTube)
"""End effectors of instruments that may be exchanged: a jaw of the name `jaw`, or none."""


class MountedPsm(PsmTool, MountedArm):
    """A patient-side manipulator: base pose, instrument and start."""

    probe_radius: Length = Field(
        default=PROBE_RADIUS, gt=0.0, description="radius of the sphere of a palpation probe"
    )
    hand: HandPositions = Field(
        default=FOLDED,
        description="closings, then spreads, of a hand's fingers at time 0; default: folded",
    )
    touches: tuple[Name, ...] = Field(
        default=(),
        description=(
            "organs that the instrument touches: the tissue gets a probe of the arm's name, and the session a"
            " bond between both; state either for numbers of your own"
        ),
    )

    spares: tuple[InstrumentName, ...] = Field(
        default=(),
        description=(
            "instruments that the arm may be given in exchange while the session runs: names or numbers;"
            " with a jaw or a rigid tip, and with the wrist of an 8 mm instrument"
        ),
    )

    @property
    def variants(self) -> tuple[Self, ...]:
        """The arm as mounted, then with each spare instrument, its joints at the start."""
        return self, *self._with_spares

    @cached_property
    def _with_spares(self) -> tuple[Self, ...]:
        fields = {name: getattr(self, name) for name in type(self).model_fields} | {"spares": ()}
        return tuple(
            self.model_construct(self.model_fields_set, **(fields | {"instrument": spare, "jaw": 0.0}))
            for spare in self.spares
        )

    def by_owner(self, arm: str) -> Mapping[str, Self]:
        """Return the variants of `arm` by the prefix of names in a model: `PSM1`, `PSM1/<spare>`."""
        mounted, *others = self.variants
        return {arm: mounted} | {f"{arm}/{other.instrument.replace('-', '_')}": other for other in others}

    @model_validator(mode="after")
    def _exchanges_what_fits(self) -> Self:
        if not self.spares:
            return self
        if self.tip is not None or self.dynamics is not None:
            raise ValueError("spares: not beside `tip` or `dynamics`, which are those of one instrument")
        tools = [instrument(name) for name in (self.instrument, *self.spares)]
        for tool in tools:
            if len(tool.joints) != _WRISTED or type(tool.end_effector) not in _EXCHANGED:
                raise ValueError(
                    f"spares: {tool.name} cannot be exchanged while a session runs; allowed are instruments"
                    " with roll, wrist and a jaw or a rigid tip"
                )
            if tools.count(tool) > 1:
                raise ValueError(f"spares: {tool.name} is named twice; name each instrument once")
        for variant in self.variants[1:]:
            try:
                variant.chain.check(np.array(self.start, np.float64))
            except MotionError as error:
                raise ValueError(f"spares: with {variant.instrument} {error}") from error
        return self

    @cached_property
    def tool(self) -> Instrument:
        """The instrument's numbers; a palpation probe with the scene's radius."""
        tool = super().tool
        is_probe = isinstance(tool.end_effector, Probe)
        return replace(tool, end_effector=Probe(self.probe_radius)) if is_probe else tool

    @property
    def reach(self) -> float:
        """Largest distance of the instrument's end from the remote centre of motion, m."""
        out = np.array([joint.upper if joint.kind == "prismatic" else 0.0 for joint in self.chain.joints])
        return float(np.linalg.norm(self.chain.forward(out)[:3, 3])) + self._extent

    @property
    def sphere_centres(self) -> Vector:
        """Centres of the contact spheres in the tip's frame, every joint at 0, m, shape (n, 3).

        A palpation probe is one sphere at the tip.
        """
        if isinstance(self.end_effector, Probe):
            return np.zeros((1, 3))
        mount = Mount.on(self.chain)
        poses = {link.name: link.pose for link in self.end_effector_links} | {mount.link: mount.pose}
        from_base = inverse_transform(mount.tip)
        centres = [from_base @ poses[one.link] @ (*one.position, 1.0) for one in self.spheres]
        return np.array(centres).reshape(-1, 4)[:, :3]

    @property
    def _extent(self) -> float:
        """Distance of the end of the farthest sphere from the tip, m."""
        radius = self.probe_radius if isinstance(self.end_effector, Probe) else 0.0
        radius = max([radius, *(sphere.radius for sphere in self.spheres)])
        return radius + max(np.linalg.norm(self.sphere_centres, axis=1).tolist(), default=0.0)

    @property
    def _driven(self) -> list[str]:
        jaw = [] if self.tool.jaw is None else [JAW]
        return [*super()._driven, *jaw]

    @property
    def _published(self) -> Published:
        driven = drives.psm(self.tool, self.generation)
        return arm_bodies.psm(self.tool), driven, drives.discs(self.tool)

    @property
    def _stated_positions(self) -> Mapping[str, Sequence[float]]:
        return {**super()._stated_positions, "hand": self.hand}
