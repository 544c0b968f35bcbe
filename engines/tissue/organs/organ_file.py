"""The file of an organ of a user's own, written by `trocar organs import` and named in a scenario."""

from __future__ import annotations

from io import StringIO
from pathlib import Path
from typing import Any, Self, cast

from pydantic import BaseModel, ConfigDict, Field
from ruamel.yaml import YAML
from ruamel.yaml.scalarstring import LiteralScalarString

from engines.tissue.files.vtk_file import parse_vtk
from engines.tissue.meshing.mesh_check import checked_mesh
from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.picks import NodePick, SurfacePick
from schemas.scenario import Name
from schemas.yaml_model import load_yaml_model

__all__ = ["OrganFile"]

_LARGEST = 4 * 10**6
"""Bytes; an organ of 5000 nodes has less than one million."""


class OrganFile(BaseModel):
    """The content of a YAML file, SI units: an organ's mesh, its surfaces, and their provenance.

    One file, so that a recording knows its contents by one hash.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    source: dict[str, Any] = Field(default_factory=dict[str, Any])
    """Files with hashes, unit, shift of the frame and changes of the mesh; for the reader."""
    material: str | None = None
    """The default preset."""
    anchors: tuple[str, ...] = ()
    """Surfaces anchored by default."""
    surfaces: dict[Name, SurfacePick | NodePick] = Field(default_factory=dict[str, SurfacePick | NodePick])
    """Named parts of the surface."""
    mesh: str
    """Tetrahedra as a legacy .vtk file, m."""

    @classmethod
    def load(cls, file: Path) -> Self:
        """Return the content of `file`. Raises ValueError for an unreadable or invalid file."""
        return load_yaml_model(cls, file, largest=_LARGEST, writer="trocar organs import", error=ValueError)

    @property
    def tet_mesh(self) -> TetMesh:
        """The tetrahedra. Raises ValueError if unusable."""
        return checked_mesh(*parse_vtk(self.mesh.encode()))

    def text(self) -> str:
        """Return the content as YAML."""
        content = self.model_dump(mode="json", exclude_defaults=True)
        content["mesh"] = LiteralScalarString(self.mesh)
        stream, yaml = StringIO(), cast("Any", YAML())
        yaml.dump(content, stream)
        return stream.getvalue()
