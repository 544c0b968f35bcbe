"""The dynamics of the reader's own arm, written by `trocar identify` and named in a scenario.

A file of YAML: the inertia of the arm's bodies, the losses of joints and discs, and the fit. SI units,
radians; bodies stand in the arm's base frame with every joint at 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from robots.dvrk.drive import SMOOTHING, Disc, Drive
from robots.dvrk.end_effectors.jaw import FINGER_PAIRS, FINGERS
from robots.dvrk.inertia import Inertia
from schemas.errors import MotionError
from schemas.yaml_model import load_yaml_model, yaml_text

__all__ = ["JAW", "BodyInertia", "DiscLosses", "JointLosses", "OwnDynamics"]

JAW = "jaw"
"""The joint for the two fingers of an instrument."""

_LARGEST = 2**20
"""Most bytes of a file; usual are 4 KiB."""

_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
_NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
_Row = tuple[_Finite, _Finite, _Finite]


_Rubbing = TypeVar("_Rubbing", Drive, Disc)


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class BodyInertia(_Part):
    """Mass (kg), centre (m) and inertia tensor about the centre (kg m^2) of a body."""

    mass: _Positive
    centre: _Row
    tensor: tuple[_Row, _Row, _Row]

    @property
    def inertia(self) -> Inertia:
        """The same as arrays."""
        return Inertia(self.mass, np.array(self.centre), np.array(self.tensor))

    @model_validator(mode="after")
    def _is_of_a_body(self) -> Self:
        tensor = np.array(self.tensor)
        if not np.allclose(tensor, tensor.T) or np.linalg.eigvalsh(self.inertia.pseudo_inertia)[0] <= 0.0:
            raise ValueError(
                "no body has this inertia tensor: it must be symmetric, its moments positive, and the sum of"
                " any two larger than the third"
            )
        return self


class DiscLosses(_Part):
    """Friction: viscous v + (coulomb + static exp(-(v / stribeck)^2)) tanh(smoothing v).

    The simulation has viscous and Coulomb friction only.
    """

    viscous: _NotNegative = 0.0
    coulomb: _NotNegative = 0.0
    smoothing: _Positive = SMOOTHING
    static: _NotNegative = 0.0
    stribeck: _Positive | None = None

    def of(self, published: _Rubbing) -> _Rubbing:
        """Return `published` with this friction."""
        return replace(
            published,
            viscous_friction=self.viscous,
            coulomb_friction=self.coulomb,
            smoothing=self.smoothing,
            static_friction=self.static,
            stribeck_velocity=inf if self.stribeck is None else self.stribeck,
        )


class JointLosses(DiscLosses):
    """Losses of a joint: effort = armature ddq + stiffness q + offset + friction."""

    armature: _NotNegative
    stiffness: _Positive
    offset: _Finite


class OwnDynamics(_Part):
    """The content of a file."""

    instrument: str
    """Instrument during identification; endoscope of an ECM."""
    bodies: dict[str, BodyInertia]
    joints: dict[str, JointLosses]
    discs: list[DiscLosses]
    fingers: list[DiscLosses] = Field(default_factory=list[DiscLosses], max_length=len(FINGER_PAIRS))
    """Friction of `FINGER_PAIRS`; empty if the jaw was at rest."""
    fit: dict[str, Any] = Field(default_factory=dict[str, Any])
    """Method and quality of the fit; for the reader."""

    @classmethod
    def load(cls, file: Path) -> Self:
        """Return the content of `file`. Raises MotionError if the file is unreadable or invalid."""
        return load_yaml_model(cls, file, largest=_LARGEST, writer="trocar identify", error=MotionError)

    def text(self) -> str:
        """Return the content as YAML."""
        return yaml_text(self, compact=True)

    def bodies_of(self, published: Mapping[str, Inertia]) -> Mapping[str, Inertia]:
        """Return `published` with the bodies identified."""
        return {**published, **{name: body.inertia for name, body in self.bodies.items()}}

    def drives_of(self, published: Mapping[str, Drive]) -> Mapping[str, Drive]:
        """Return `published` with the losses identified."""
        drives = dict(published)
        for name, losses in self.joints.items():
            # the effort of a jaw turns two fingers by half the angle each
            halves, joints = (2.0, FINGERS) if name == JAW else (1.0, (name,))
            for joint in joints:
                drives[joint] = replace(
                    losses.of(published[joint]),
                    elasticity=halves * losses.stiffness,
                    offset=losses.offset,
                    armature=halves * losses.armature,
                )
        return drives

    def discs_of(self, published: tuple[Disc, ...]) -> tuple[Disc, ...]:
        """Return `published` with the friction identified, then the rubbing pairs of the fingers."""
        discs = zip(published, self.discs, strict=True)
        return tuple(own.of(disc) for disc, own in (*discs, *zip(FINGER_PAIRS, self.fingers, strict=False)))
