"""Parameters of an organ."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from engines.tissue.frequencies import highest_frequency, lowest_frequency, patch_stiffness
from engines.tissue.material import Material
from engines.tissue.meshing.grid import FEWEST_NODES
from engines.tissue.meshing.mesh_check import LARGEST_M, MOST_NODES, SMALLEST_M
from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.anchors import AnchorParams, Edges
from engines.tissue.organs.bleeding import BleedingParams
from engines.tissue.organs.catalogue import SHAPES, block_shape
from engines.tissue.organs.cutting import CuttingParams
from engines.tissue.organs.inner_wall import InnerWall, wall_around
from engines.tissue.organs.layers import LayerParams
from engines.tissue.organs.lumen import LumenParams
from engines.tissue.organs.material_file import MaterialFile
from engines.tissue.organs.materials import TissueDensity, TissueModulus, TissuePoissonRatio, preset
from engines.tissue.organs.prony import PronySeries, PronyTerm
from engines.tissue.organs.shape import Shape
from engines.tissue.organs.shape_file import ORGAN_SUFFIXES, is_surface_file, read_shape
from engines.tissue.organs.sheet import SheetParams, sheet_shape
from engines.tissue.organs.tube import TubeParams, tube_shape
from engines.tissue.organs.visceral_face import VisceralFaceParams, visceral_shape
from robots import rotation
from robots.dvrk.parameters import UnitQuaternion
from schemas.files import find_file
from schemas.plain_sum import plain_sum
from schemas.quantity import Duration, Length
from schemas.vectors import Vector

__all__ = ["OrganParams"]

_NODES = 250
_POISSON_RATIO = 0.4
_FLATTEST = 0.15
"""Least height of a layer's row of cells, over the length of its cells: flatter ones need short sub-steps."""
_DENSITY = 1000.0
"""Density of water, kg/m^3."""

_UNITS = {"m": 1.0, "mm": 1e-3}


class OrganParams(BaseModel):
    """An organ of soft tissue: shape, material, pose and anchors.

    SI units after validation.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    size: Edges | None = Field(default=None, description="of a block of tissue: edge lengths along x, y, z")
    shape: Literal["kidney-with-adrenal", "colon", "liver-lobe"] | None = Field(
        default=None, description="instead: an organ; `trocar organs` shows them"
    )
    mesh: Path | None = Field(
        default=None,
        description=(
            "instead: an organ of `trocar organs import` (.yaml), tetrahedra (.vtk, .vtu, .msh, .med) or a"
            " closed surface (.stl, .obj, .ply, .glb, .gltf); a relative path starts at the scenario"
        ),
    )
    tube: TubeParams | None = Field(default=None, description="instead: a duct, a vessel or a pouch")
    visceral_face: VisceralFaceParams | None = Field(
        default=None, description="instead: the part of a liver about the gallbladder"
    )
    sheet: SheetParams | None = Field(
        default=None, description="instead: peritoneum with fat, draped over what lies below"
    )
    unit: Literal["m", "mm"] | None = Field(
        default=None, description="of the file of tetrahedra or of a surface; default: m"
    )
    material: str | None = Field(
        default=None,
        description=(
            "name of a material that `trocar organs` shows with its source; default: that of the shape"
        ),
    )
    material_file: Path | None = Field(
        default=None,
        description=(
            "instead: a file of `trocar calibrate tissue`, with a damping and perhaps a friction of its own;"
            " a relative path starts at the scenario"
        ),
    )
    young_modulus: TissueModulus | None = Field(
        default=None, description="instead of a material, or of its own: heat is then that of the material"
    )
    poisson_ratio: TissuePoissonRatio | None = Field(
        default=None, description=f"with young_modulus; default: {_POISSON_RATIO}"
    )
    density: TissueDensity | None = Field(default=None, description="with young_modulus; default: water")
    layers: tuple[LayerParams, ...] = Field(
        default=(),
        max_length=8,
        description="of a block, from its top down, kind fem alone; below them is the organ's own material",
    )
    nodes: int | None = Field(
        default=None,
        ge=FEWEST_NODES,
        le=MOST_NODES,
        description=f"about how many; default: {_NODES}, which run in real time at sub-steps of 1 ms",
    )
    position: tuple[Length, Length, Length] = Field(
        default=(0.0, 0.0, 0.0),
        description="of the organ's frame in `world`; that of a block is in the middle of its top",
    )
    orientation: UnitQuaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0), description="of the organ's frame in `world`: quaternion x, y, z, w"
    )
    anchors: tuple[AnchorParams, ...] | None = Field(
        default=None, description="what holds the organ; default: the shape's own surfaces, tied to `world`"
    )
    damping: Duration = Field(
        default=1_000_000,
        ge=0,
        le=1_000_000_000,
        description="stiffness-proportional damping: ratio of damping to stiffness, a time",
    )
    prony: PronySeries = Field(
        default=(),
        description=(
            "relaxation, kind fem: up to three terms of share (of the instantaneous shear modulus) and"
            " seconds; the Young's modulus is that after all relaxation; default: that of the material_file"
        ),
    )
    friction: float = Field(default=0.3, ge=0, le=2, description="Coulomb coefficient against probes")
    inertia: float = Field(
        default=1.0,
        ge=1,
        le=100,
        description=(
            "mass for motion over that for weight, kind fem alone: small stiff organs move more slowly and"
            " allow sub-steps longer by its square root"
        ),
    )
    cutting: CuttingParams | None = Field(
        default=None, description="lets blades cut the tissue, and pulls tear it; kind fem alone"
    )

    lumen: LumenParams | None = Field(
        default=None, description="liquid under pressure in a tube, which an opening lets out; kind fem alone"
    )
    bleeding: BleedingParams | None = Field(
        default=None, description="lets opened tissue bleed; with `cutting`, kind fem alone"
    )

    @field_validator("mesh", "material_file")
    @classmethod
    def _from_scenario(cls, path: Path | None, info: ValidationInfo) -> Path | None:
        return path and find_file(path, info)

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        forms = self.size, self.shape, self.mesh, self.tube, self.visceral_face, self.sheet
        if sum(form is not None for form in forms) != 1:
            raise ValueError(
                f"an organ has a size (a block), a shape ({', '.join(SHAPES)}), a mesh (a file), a tube, a"
                " visceral_face or a sheet, one of them"
            )
        if self.lumen is not None and (self.tube is None) != bool(self.lumen.line):
            raise ValueError(
                "a lumen is that of a `tube`, or of a hollow mesh around the `line` of its lumen: state one"
            )
        if self.size is not None and not SMALLEST_M <= max(self.size) <= LARGEST_M:
            raise ValueError(
                f"the longest edge of a block is {SMALLEST_M:g} to {LARGEST_M:g} m, not {max(self.size):g} m"
            )
        if self.layers:
            self._check_layers()
        if self.mesh is None and self.unit is not None:
            raise ValueError("unit is that of a mesh file; elsewhere units stand with the numbers")
        if self.mesh is not None and self.nodes is not None and not is_surface_file(self.mesh):
            raise ValueError("nodes are those of the mesh file: leave them out")
        if self.mesh is not None and self.unit is not None and self.mesh.suffix in ORGAN_SUFFIXES:
            raise ValueError(
                "unit is that of another program's file; files of `trocar organs import` are in m"
            )
        if self.mesh is not None and self.anchors is None and not self.body.anchors:
            raise ValueError(
                "anchors are missing: state what holds the organ, for instance [{surface: bottom}], or [] if"
                " it lies freely on rigid parts"
            )
        if self.bleeding is not None and self.cutting is None:
            raise ValueError("tissue bleeds where it is opened: bleeding goes with `cutting`")
        if self.young_modulus is None and (self.poisson_ratio is not None or self.density is not None):
            raise ValueError("poisson_ratio and density go with young_modulus; a material has its own")
        if self.material_file is not None and (self.material is not None or self.young_modulus is not None):
            raise ValueError("an organ has a material_file, or a material or young_modulus: one of them")
        _ = self.elastic, self.local, self.anchored_nodes, self.inner_wall
        return self

    def _check_layers(self) -> None:
        names = [layer.name for layer in self.layers]
        if self.size is None:
            raise ValueError("layers are those of a block: state its size, or leave them out")
        if len(set(names)) < len(names):
            raise ValueError(f"two layers have the same name: {', '.join(names)}")
        if (thick := plain_sum(layer.thickness for layer in self.layers)) >= self.size[2]:
            raise ValueError(f"layers of {thick:g} m fill a block of {self.size[2]:g} m: make them thinner")
        row, cell = (float(np.diff(np.unique(self.local.nodes[:, axis])).min()) for axis in (2, 0))
        if row < _FLATTEST * cell:
            raise ValueError(
                f"a layer has cells {1e3 * row:.2g} mm high and {1e3 * cell:.2g} mm long: make it"
                f" {1e3 * _FLATTEST * cell:.2g} mm thick at least, or state more nodes"
            )

    @cached_property
    def elastic(self) -> Material:
        """The material in numbers. Raises ValueError where none is given."""
        damping = self.damping * 1e-9
        if (own := self._own_material) is not None:
            if "damping" not in self.model_fields_set:
                damping = own.damping
            return Material(own.young_modulus, own.poisson_ratio, own.density, damping)
        if self.young_modulus is not None:
            poisson_ratio, density = self.poisson_ratio, self.density
            if self.material is not None:
                preset(self.material)  # refuses a name that is not known
            return Material(
                self.young_modulus,
                _POISSON_RATIO if poisson_ratio is None else poisson_ratio,
                _DENSITY if density is None else density,
                damping,
            )
        name = self.material_name
        if name is None:
            raise ValueError(
                "the material is missing: state young_modulus, or a material (`trocar organs` lists them)"
            )
        known = preset(name)
        return Material(known.young_modulus, known.poisson_ratio, known.density, damping)

    @property
    def material_name(self) -> str | None:
        """Name of the material, as stated or of the shape; None: a modulus alone, or a file."""
        if self.material is not None:
            return self.material
        is_own = self.young_modulus is not None or self.material_file is not None
        return None if is_own else self.body.material

    @cached_property
    def relaxed(self) -> Material:
        """The material after all relaxation by `series`."""
        own = self._own_material
        if own is None or own.long_term_young_modulus is None or self.prony:
            return self.elastic
        return replace(self.elastic, young_modulus=own.long_term_young_modulus, damping=self.damping * 1e-9)

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """The relaxed materials of the layers from the top down, then the organ's own."""
        return *(layer.elastic(self.relaxed.damping) for layer in self.layers), self.relaxed

    def layer_numbers(self, tetrahedra: NDArray[np.integer]) -> NDArray[np.uint8]:
        """Return the number among `materials` of every element, shape (m,).

        tetrahedra: nodes of the elements, shape (m, 4).
        """
        depths = -self.local.nodes[tetrahedra, 2].mean(axis=1)
        ends: Vector = np.cumsum([layer.thickness for layer in self.layers], dtype=np.float64)
        return np.asarray(np.searchsorted(ends, depths), np.uint8)

    @cached_property
    def series(self) -> tuple[PronyTerm, ...]:
        """Relaxation: as stated, else from the material file, if any."""
        own = self._own_material
        return self.prony if self.prony or own is None else own.prony

    @cached_property
    def contact_friction(self) -> float:
        """Coulomb's coefficient against probes: as stated, else from the material file, if any."""
        own = self._own_material
        if own is None or own.friction is None or "friction" in self.model_fields_set:
            return self.friction
        return own.friction

    @cached_property
    def _own_material(self) -> MaterialFile | None:
        return None if self.material_file is None else MaterialFile.load(self.material_file)

    @cached_property
    def body(self) -> Shape:
        """The shape. Raises ValueError where the mesh file is unusable."""
        if self.size is not None:
            layers = tuple(layer.thickness for layer in self.layers)
            return block_shape(self.size, layers, tuple(layer.rows for layer in self.layers))
        if self.tube is not None:
            return tube_shape(self.tube)
        if self.visceral_face is not None:
            return visceral_shape(self.visceral_face)
        if self.sheet is not None:
            return sheet_shape(self.sheet)
        if self.mesh is not None:
            return read_shape(self.mesh, _UNITS[self.unit or "m"], self.nodes or _NODES)
        return SHAPES[self.shape or ""]

    @cached_property
    def inner_wall(self) -> InnerWall | None:
        """The inner wall of a tube with a lumen. Raises ValueError for a mesh that is not hollow."""
        if self.lumen is None:
            return None
        if self.tube is not None:
            return self.tube.inner_wall(self.local, self.nodes or _NODES)
        return wall_around(self.local, np.array(self.lumen.line))

    @cached_property
    def local(self) -> TetMesh:
        """The mesh at rest in the organ's own frame."""
        return self.body.mesh(self.nodes or _NODES)

    @cached_property
    def rest(self) -> TetMesh:
        """The mesh at rest in `world`."""
        turned = np.einsum("ij,nj->ni", rotation.matrix(np.array(self.orientation)), self.local.nodes)
        return TetMesh(turned + np.array(self.position), self.local.tetrahedra)

    @property
    def anchored_nodes(self) -> dict[str, NDArray[np.bool_]]:
        """Nodes tied to `world` and to rigid parts, shapes (n,).

        Raises ValueError for an unknown surface or a surface without nodes.
        """
        anchors = (
            [AnchorParams(surface=name) for name in self.body.anchors]
            if self.anchors is None
            else self.anchors
        )
        tied: dict[str, NDArray[np.bool_]] = {}
        for anchor in anchors:
            tied[anchor.to] = tied.get(anchor.to, np.zeros(len(self.local.nodes), np.bool_)) | self.surface(
                anchor
            )
        return tied

    @cached_property
    def frequencies(self) -> tuple[float, float | None]:
        """Highest natural frequency, and frequency of the slowest swing, rad/s; None: no anchors.

        Kept, because the frequencies take a third of the time to make an organ, and each episode of learning
        makes the organ anew.
        """
        tied = np.any(list(self.anchored_nodes.values()), axis=0)
        free = np.where(tied, 0.0, np.ones(len(self.rest.nodes)))
        return (
            highest_frequency(self.rest, free, self.elastic),
            lowest_frequency(self.rest, free, self.elastic) if np.any(tied) else None,
        )

    def surface(self, part: AnchorParams) -> NDArray[np.bool_]:
        """Return the nodes of a part of the surface, shape (n,).

        Raises ValueError for an unknown part or a part without nodes.
        """
        nodes, chosen = np.unique(self.local.triangles), np.zeros(len(self.local.nodes), np.bool_)
        points = self.local.nodes[nodes]
        if part.surface is None:
            chosen = part.nodes(self.local)
        elif part.surface in self.body.picks:
            chosen = self.body.picks[part.surface].nodes(self.local)
        else:
            chosen[nodes] = self.body.surface(part.surface, points)
        if not chosen.any():
            raise ValueError(
                f"no node of the surface lies in {part.surface or _conditions(part)}; the organ reaches from"
                f" {points.min(axis=0)} to {points.max(axis=0)} m"
            )
        return chosen

    def contact_stiffness(self, radius: float) -> float:
        """Estimate the stiffness (N/m) against a sphere of `radius` (m).

        The estimate is for a punch as wide as the sphere, or as a longer median edge of the surface.
        """
        width = max(radius, self._median_edge)
        layers = (layer.elastic(self.elastic.damping) for layer in self.layers)
        return max(material.contact_stiffness(width) for material in (self.elastic, *layers))

    def patch_stiffness(self, patch: NDArray[np.bool_]) -> float:
        """Return the largest stiffness (N/m) against nodes, shape (n,), that move together."""
        layers = (layer.elastic(self.elastic.damping) for layer in self.layers)
        return max(patch_stiffness(self.rest, patch, material) for material in (self.elastic, *layers))

    @cached_property
    def _median_edge(self) -> float:
        """Of the surface, m."""
        triangles = self.local.triangles
        edges = self.local.nodes[triangles] - self.local.nodes[np.roll(triangles, 1, axis=1)]
        return float(np.median(np.linalg.norm(edges, axis=2)))


def _conditions(part: AnchorParams) -> str:
    stated = [name for name in ("box", "normal", "plane") if getattr(part, name) is not None]
    return f"the {' and the '.join(stated)}"
