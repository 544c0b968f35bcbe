"""Declarations of contact in parameters: tools that press on tissue, and surfaces of tissue.

From both, planning makes the probe and the bond of `touches`, and finds tools that pass through tissue.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from hub.participant.base import Params
from schemas.vectors import Vector

__all__ = ["Surface", "TissueParams", "Tool", "ToolParams"]


@dataclass(frozen=True)
class Tool:
    """A tool on an arm; lengths in m."""

    name: str
    """Name of the arm, and of the probe that planning makes; of a spare instrument, `<arm>_<instrument>`."""
    touches: tuple[str, ...]
    """Names of the bodies of tissue to touch, as stated."""
    path: tuple[str | int, ...]
    """Place of `touches` in the parameters."""
    bond: str
    """Motion side of the contact; empty for a tool without contact."""
    probe: Mapping[str, Any]
    """Parameters of a probe for the tool: spheres, radius, grasp, energy."""
    tip: str
    """Output with the pose of the tip in the arm's base frame."""
    base: Vector
    """Pose of the arm's base frame in the world, shape (4, 4); origin is the remote centre of motion."""
    reach: float
    """Largest distance of the tool's end from the remote centre of motion."""
    spheres: Vector
    """Centres of the contact spheres in the tip's frame, end effector closed, shape (n, 3)."""
    is_spare: bool = False
    """Whether the tool comes into the arm in an exchange alone: its spheres leap there from far away."""


@dataclass(frozen=True)
class Surface:
    """A closed surface of tissue at rest, in the world."""

    nodes: Vector
    """m, shape (n, 3)."""
    triangles: NDArray[np.int64]
    """Three nodes of each triangle, shape (f, 3)."""


class ToolParams(Params):
    """Base of the parameters of a kind with tools: the motion side of contacts."""

    @property
    @abstractmethod
    def tools(self) -> Sequence[Tool]:
        """The tools, one at a time on each arm."""


class TissueParams(Params):
    """Base of the parameters of a kind with tissue: the force side of contacts.

    The kind has a parameter `probes` by name, each the force side of a bond of the same name. A probe touches
    all bodies of the participant.
    """

    unused_of_tools: ClassVar[frozenset[str]] = frozenset()
    """Parameters of a tool's probe without meaning in this kind: planning leaves them out."""
    bears_exchanges: ClassVar[bool] = False
    """Whether probes may leap, as spheres do in an exchange of instruments."""

    @property
    @abstractmethod
    def bodies(self) -> Mapping[str, Surface]:
        """The bodies of tissue by name."""
