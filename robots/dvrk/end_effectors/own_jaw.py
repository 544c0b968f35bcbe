"""A jaw with fingers of the user's own, from a file of `trocar instruments import`. SI units, radians.

A finger stands in the frame of a closed jaw: x in the opening direction of the left finger, y along the
hinge, z to the tip, origin on the hinge between the fingers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from io import StringIO
from math import radians
from pathlib import Path
from typing import Annotated, Any, Self, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, field_validator
from ruamel.yaml import YAML
from ruamel.yaml.scalarstring import LiteralScalarString

from robots.dvrk.end_effectors.contact_sphere import FINGER_HALF_WIDTH
from robots.dvrk.end_effectors.end_effector import Mount
from robots.dvrk.end_effectors.jaw import FINGERS, Jaw
from robots.dvrk.inertia import Inertia
from robots.dvrk.instruments import Instrument
from schemas.errors import MotionError
from schemas.scenario import Name
from schemas.vectors import Vector
from schemas.yaml_model import load_yaml_model

__all__ = ["LONGEST", "SHORTEST", "Finger", "JawFile", "OwnJaw", "with_own_jaw"]

SHORTEST, LONGEST = 5e-3, 60e-3
"""Limits of a finger's length, m: instruments of the dVRK have 10 to 29 mm."""

_LARGEST = 4 * 2**20
"""Most bytes of a file: two fingers of 20 000 faces."""


class Finger(BaseModel):
    """Mass and surface of a finger."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    mass: float = Field(gt=1e-7, lt=0.05)
    """kg."""
    surface: str
    """Triangles as the text of an .obj file: lines `v X Y Z` (m), then lines `f I J K`, counted from 1."""

    @field_validator("surface")
    @classmethod
    def _is_surface(cls, text: str) -> str:
        vertices, faces = _parse_obj(text)
        if len(vertices) < 4 or len(faces) < 4 or not 0 <= faces.min() <= faces.max() < len(vertices):
            raise ValueError("no surface: a face names a vertex that is not there, or there are fewer than 4")
        if not np.isfinite(vertices).all() or np.abs(vertices).max() > 2.0 * LONGEST:
            raise ValueError(f"a vertex is not finite, or farther than {2.0 * LONGEST:g} m from the hinge")
        return text

    @cached_property
    def triangles(self) -> tuple[Vector, NDArray[np.int32]]:
        """Vertices, m, shape (n, 3), and faces, shape (m, 3)."""
        return _parse_obj(self.surface)

    @classmethod
    def of(cls, mass: float, vertices: Vector, faces: NDArray[np.int32]) -> Self:
        """Return a finger of this surface, to the micrometre."""
        rows = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices.tolist()]
        rows += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
        return cls(mass=mass, surface="\n".join([*rows, ""]))


class JawFile(BaseModel):
    """The content of a YAML file: two fingers about one hinge, and their provenance."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Name
    source: str = ""
    """File, links, and what was done; for the reader."""
    length: Annotated[float, Field(ge=SHORTEST, le=LONGEST)]
    """Distance of the fingers' end from the hinge, m."""
    opening: Annotated[float, Field(gt=0.0, le=radians(180.0))]
    """Largest angle between the fingers, rad."""
    left: Finger
    right: Finger

    def __hash__(self) -> int:
        """Return a hash of the surfaces: a cache finds the file by it."""
        return hash((self.name, self.left.surface, self.right.surface))

    @classmethod
    def load(cls, file: Path) -> Self:
        """Return the content of `file`. Raises MotionError if the file is unreadable or invalid."""
        return load_yaml_model(
            cls, file, largest=_LARGEST, writer="trocar instruments import", error=MotionError
        )

    def text(self) -> str:
        """Return the content as YAML."""
        content = self.model_dump(mode="json")
        for side in ("left", "right"):
            content[side]["surface"] = LiteralScalarString(content[side]["surface"])
        stream, yaml = StringIO(), cast("Any", YAML())
        yaml.dump(content, stream)
        return stream.getvalue()


@dataclass(frozen=True)
class OwnJaw(Jaw):
    """A jaw with the fingers of a file, driven as the jaw in whose place it stands."""

    left: Finger = field(kw_only=True)
    right: Finger = field(kw_only=True)

    def bodies(self, mount: Mount, /) -> Mapping[str, Inertia]:
        """Return the fingers, closed, as rods of their masses."""
        end = mount.pose[:3, 3]
        ends = end, end + self.length * mount.ahead
        return {
            name: Inertia.of_rod(finger.mass, *ends, FINGER_HALF_WIDTH)
            for name, finger in zip(FINGERS, (self.left, self.right), strict=True)
        }


@lru_cache(maxsize=16)  # one object for each, as `instrument` has: looks are drawn once for an object
def with_own_jaw(shaft: Instrument, file: JawFile) -> Instrument:
    """Return an instrument with the jaw of `file` on the shaft and wrist of `shaft`; the tip is at the end.

    Raises MotionError if `shaft` has another end effector than a plain jaw.
    """
    jaw = shaft.end_effector
    if type(jaw) is not Jaw:
        raise MotionError(
            f"'{shaft.name}' has no plain jaw that the fingers could replace; take an instrument with one,"
            " such as 400006"
        )
    tip = shaft.tip.copy()
    tip[:3, 3] = file.length * tip[:3, 2]
    numbers = (min(jaw.lower, 0.0), file.opening, jaw.effort, file.length, jaw.disc_share)
    own = OwnJaw(*numbers, left=file.left, right=file.right)
    source = f"{shaft.source} (shaft and wrist); {file.source}"
    return replace(shaft, name=file.name, number="", tip=tip, end_effector=own, source=source)


def _parse_obj(text: str) -> tuple[Vector, NDArray[np.int32]]:
    """Return vertices and faces. Raises ValueError for any other line."""
    rows = [line.split() for line in text.splitlines() if line]
    if bad := next((row for row in rows if len(row) != 4 or row[0] not in "vf"), None):
        raise ValueError(f"no surface: '{' '.join(bad):.60}' is neither 'v X Y Z' nor 'f I J K'")
    vertices = np.array([row[1:] for row in rows if row[0] == "v"], np.float64).reshape(-1, 3)
    faces = np.array([row[1:] for row in rows if row[0] == "f"], np.int32).reshape(-1, 3) - 1
    return vertices, faces.astype(np.int32)
