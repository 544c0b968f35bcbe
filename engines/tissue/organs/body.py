"""An organ in an engine, for the code that engines share."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from engines.tissue.meshing.tet_mesh import Indices, TetMesh
from engines.tissue.tissue_surface import TissueSurface
from schemas.vectors import Vector

__all__ = ["Body", "ChangingBody"]


class Body(Protocol):
    """An organ as an engine has placed it."""

    @property
    def name(self) -> str:
        """Name of the organ."""
        ...

    @property
    def mesh(self) -> TetMesh:
        """Mesh at rest, in `world`."""
        ...

    @property
    def nodes(self) -> Vector:
        """Nodes at the last reading, m, in `world`, shape (n, 3)."""
        ...

    @property
    def anchored(self) -> NDArray[np.bool_]:
        """Anchored nodes, shape (n,)."""
        ...

    @property
    def touchable(self) -> Indices:
        """Faces with a free node, shape (f, 3)."""
        ...


class ChangingBody(Body, Protocol):
    """An organ whose surface may change: it is cut, torn or burnt."""

    @property
    def surface(self) -> TissueSurface:
        """The surface as it is now."""
        ...
