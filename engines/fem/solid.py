"""A soft body of linear tetrahedra in explicit dynamics; `_solid.c` steps it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engines.fem.arrays import aligned_floats, aligned_integers, in_blocks
from engines.fem.boxes import NO_BOXES
from engines.fem.edges import NO_EDGES, Edges
from engines.fem.faces import Faces
from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices, TetMesh, volumes
from schemas.errors import ScenarioError
from schemas.vectors import Vector

__all__ = ["Branch", "Layering", "Solid", "SphereWay"]

_LANES = 4
"""Elements of a block, as in `_lanes.h`."""
_STEP_SHARE = 0.7
"""Sub-step over the longest stable one of the resting mesh, 2 / highest frequency: a compressed mesh is
stiffer.
"""
_PIECE_SHARE = 0.9
"""Sub-step over that for a bound of the highest frequency of every piece of the body."""
_SHARPER = 2.5
"""Sharpness of an element that a cut may shape, over the largest of the uncut mesh: the square of the
frequency.
"""
_POWER_ITERATIONS = 80
_PROBE_STRAIN = 1e-4
"""Size of the displacements that measure the stiffness, in the body's extent."""
_FIXED = 1
"""Flag of an anchored node, as in `_solid.h`."""


@dataclass(frozen=True)
class Branch:
    """A branch of a generalised Maxwell model: a spring in series with a damper."""

    share: float
    """Shear modulus over the long-term shear modulus."""
    seconds: float
    """Relaxation time, s."""


@dataclass(frozen=True)
class SphereWay:
    """Ways of spheres through the sub-steps of a step."""

    path: Vector
    """Centres at the ends of the sub-steps, m, in `world`, shape (k + 1, n, 3)."""
    radii: Vector
    """m, shape (n,)."""
    free: NDArray[np.uint8]
    """0 for a sphere that passes through the body, shape (n,)."""
    edges: Edges = field(default=NO_EDGES)
    """Sharp edges between spheres."""

    def no_forces(self) -> Vector:
        """Return a force of 0 on each sphere in each sub-step, shape (k, n, 3)."""
        return np.zeros((len(self.path) - 1, len(self.radii), 3))


@dataclass(frozen=True)
class Layering:
    """Materials of a body."""

    materials: tuple[Material, ...]
    numbers: NDArray[np.uint8]
    """Number of the material of every element of the mesh, shape (m,)."""


class Solid:
    """Arrays of the body, in single precision and blocks of elements, relative to the middle of the body.

    Raises ScenarioError where `_solid.c` was not compiled.
    """

    def __init__(
        self,
        mesh: TetMesh,
        anchored: NDArray[np.bool_],
        material: Material,
        branches: Sequence[Branch] = (),
        *,
        divisible: bool = False,
        layering: Layering | None = None,
        boxes: Vector = NO_BOXES,
        most_ties: int = 0,
        weight_share: float = 1.0,
    ) -> None:
        """Build the body at rest.

        Args:
            mesh: the body.
            anchored: fixed nodes, shape (n,).
            material: of all elements without a `layering`.
            branches: relaxation.
            divisible: whether faces may open and elements go.
            layering: other materials; the largest Lame's lambda is that of all.
            boxes: rigid parts, rows of `box_rows`.
            most_ties: room for pairs of nodes that are tied to each other.
            weight_share: weight over mass and gravity, of tissue with added mass.
        """
        try:
            from engines.fem._solid import Solid as Compiled
        except ImportError as error:
            raise ScenarioError(
                "kind fem needs its part in C, which was not built: install a wheel for this platform, or"
                " install from the sources with a C compiler; or take kind bullet"
            ) from error
        self.middle: Vector = 0.5 * (mesh.nodes.min(axis=0) + mesh.nodes.max(axis=0))
        """Origin of the arrays in `world`, m."""
        self.divisible = divisible
        tetrahedra, volume, order = _in_whole_blocks(mesh)
        materials = (material,) if layering is None else layering.materials
        numbers = np.zeros(len(order), np.uint8) if layering is None else layering.numbers[order]
        lambda_ = max(one.neo_hookean_lame[1] for one in materials)
        density = np.array([one.density for one in materials])[numbers]
        self._set_elements(mesh, tetrahedra, volume, density, branches)
        self._shear = aligned_floats(np.array([one.neo_hookean_lame[0] for one in materials])[numbers])
        self._set_nodes(mesh, anchored, tetrahedra, volume, density, lambda_)
        faces = Faces(mesh, tetrahedra[volume > 0.0], len(volume))
        self._across, self._surface, self._owner = faces.across, faces.surface, faces.owner
        longest = float(np.linalg.norm(_edges_of(mesh), axis=1).max())
        self._limits = aligned_floats(np.array([lambda_, 0.0, 0.0, longest, weight_share]))
        self._boxes = boxes - np.pad(self.middle, (0, boxes.shape[1] - 3))
        self.support: Vector = np.zeros((len(boxes), 3))
        """Mean force of the body on each box in the last step, N, shape (b, 3)."""
        self._ties = aligned_integers(np.full((most_ties, 2), -1))
        self.compiled = Compiled(self._arrays, len(mesh.nodes), len(mesh.triangles))
        self.longest_step = _STEP_SHARE * 2.0 / self._highest_frequency()
        """Longest sub-step, s."""
        if divisible:
            self._limits[1:3] = self.compiled.measure()
            self._limits[1] *= _SHARPER
            self.longest_step = min(self.longest_step, _PIECE_SHARE * 2.0 / self._piece_frequency(materials))

    def _set_nodes(
        self,
        mesh: TetMesh,
        anchored: NDArray[np.bool_],
        tetrahedra: Indices,
        volume: Vector,
        density: Vector,
        lambda_: float,
    ) -> None:
        n, room = len(mesh.nodes), tetrahedra.size if self.divisible else len(mesh.nodes)
        around = np.bincount(tetrahedra.ravel(), np.repeat(volume, 4), n)
        lightest = density.min()
        more = np.bincount(tetrahedra.ravel(), np.repeat((density - lightest) * volume, 4), n)
        mass = (lightest * around + more) / 4.0  # of one material to the bit as without layers
        self._rest, self._displacement, self._velocity, self._force = (
            aligned_floats(np.zeros((room, 4))) for _ in range(4)
        )
        self._rest[:n, :3] = mesh.nodes - self.middle
        self._mass, self._inverse_mass, self._inverse_volume, self._bulk = (
            aligned_floats(np.zeros(room)) for _ in range(4)
        )
        self._mass[:n], self._inverse_volume[:n] = mass, 1.0 / around
        self._inverse_mass[:n] = np.where(anchored, 0.0, 1.0 / mass)
        self._bulk[:] = lambda_
        self._holder = aligned_integers(np.full(room, -1))
        self._origin = aligned_integers(np.arange(room))
        self._flags = np.zeros(room, np.uint8)
        self._flags[:n][anchored] = _FIXED

    def _set_elements(
        self,
        mesh: TetMesh,
        tetrahedra: Indices,
        volume: Vector,
        density: Vector,
        branches: Sequence[Branch],
    ) -> None:
        edges = mesh.nodes[tetrahedra[:, 1:]] - mesh.nodes[tetrahedra[:, :1]]
        gradients: Vector = np.asarray(np.linalg.inv(edges), np.float64).transpose(0, 2, 1).reshape(-1, 9)
        self._middles = aligned_floats(mesh.nodes[tetrahedra].mean(axis=1) - self.middle)
        self._corners = aligned_integers(in_blocks(tetrahedra, _LANES))
        self._gradients = aligned_floats(in_blocks(gradients, _LANES))
        self._volumes = aligned_floats(volume)
        self._element_mass = aligned_floats(density * volume)
        self.strains = aligned_floats(np.zeros((len(branches), len(volume) // _LANES, 6, _LANES)))
        """Viscous strains."""
        self._branch = aligned_floats(np.array([[one.share, one.seconds] for one in branches]).reshape(-1, 2))

    @property
    def _arrays(self) -> tuple[NDArray[np.generic], ...]:
        """All arrays, in the order of `_solid.c`."""
        return (
            *(self._rest, self._displacement, self._velocity, self._force),
            *(self._mass, self._inverse_mass, self._inverse_volume, self._bulk),
            *(self._holder, self._origin, self._flags),
            *(self._corners, self._gradients, self._volumes, self._element_mass, self._shear),
            *(self.strains, self._branch, self._across, self._surface, self._owner),
            *(self._middles, self._limits, self._ties, self._boxes, self.support),
        )

    @property
    def displacement(self) -> NDArray[np.float32]:
        """Displacements and pressures, m and Pa, shape (n, 4)."""
        return self._displacement[: self.compiled.counts[0]]

    @property
    def velocity(self) -> NDArray[np.float32]:
        """Velocities, m/s, shape (n, 4)."""
        return self._velocity[: self.compiled.counts[0]]

    @property
    def force(self) -> NDArray[np.float32]:
        """Forces of the elements on the nodes, N, shape (n, 4)."""
        return self._force[: self.compiled.counts[0]]

    @property
    def mass(self) -> NDArray[np.float32]:
        """Mass at the nodes, kg, shape (n,)."""
        return self._mass[: self.compiled.counts[0]]

    @property
    def inverse_mass(self) -> NDArray[np.float32]:
        """1/kg, 0 for fixed and held nodes, shape (n,)."""
        return self._inverse_mass[: self.compiled.counts[0]]

    @property
    def origin(self) -> NDArray[np.int32]:
        """Node of the uncut mesh at the place of each node, shape (n,)."""
        return self._origin[: self.compiled.counts[0]]

    @property
    def faces(self) -> NDArray[np.int32]:
        """Faces of the surface by slot, the uncut mesh's first; -1: has gone, shape (f, 3)."""
        return self._surface[: self.compiled.counts[1]]

    @property
    def elements(self) -> tuple[Indices, Vector, Vector]:
        """Corners, gradients and volumes of the elements at rest, in the order of the blocks.

        Shapes (m, 4); (m, 9), 1/m, of the shape functions of corners 1 to 3; (m,), m^3. An element that fills
        up the last block has no volume.
        """
        gradients = self._gradients.transpose(0, 2, 1).reshape(-1, 9)
        return (
            self.tetrahedra.astype(np.int64),
            gradients.astype(np.float64),
            self._volumes.astype(np.float64),
        )

    @property
    def volumes(self) -> NDArray[np.float32]:
        """Volumes of the elements at rest, m^3, 0 of one that has gone, shape (m,)."""
        return self._volumes

    @property
    def element_masses(self) -> Vector:
        """Masses of the elements, kg, 0 of one that has gone, shape (m,)."""
        return self._element_mass.astype(np.float64)

    @property
    def across(self) -> NDArray[np.int32]:
        """The face on the other side of each face of the elements, negative: none, shape (4 m,)."""
        return self._across.reshape(-1)

    @property
    def owners(self) -> NDArray[np.int32]:
        """Element of each face of the surface by slot, shape (f,)."""
        return self._owner[: self.compiled.counts[1]] // 4

    @property
    def nodes(self) -> Vector:
        """Present nodes, m, in `world`, shape (n, 3)."""
        n = self.compiled.counts[0]
        return self.middle + self._rest[:n, :3].astype(np.float64) + self._displacement[:n, :3]

    def areas(self, faces: NDArray[np.integer]) -> Vector:
        """Return the resting areas of faces, m^2, shape (f,)."""
        corners = self._rest[faces, :3].astype(np.float64)
        u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        return 0.5 * np.linalg.norm(np.cross(u, v), axis=1)

    @property
    def holder(self) -> NDArray[np.int32]:
        """Number of the sphere that holds a node, or -1, shape (n,)."""
        return self._holder[: self.compiled.counts[0]]

    @property
    def tetrahedra(self) -> NDArray[np.int32]:
        """Nodes of the elements in the body's order, those that have gone included, shape (m, 4)."""
        return self._corners.transpose(0, 2, 1).reshape(-1, 4)

    @property
    def pieces(self) -> NDArray[np.int32]:
        """Piece of the body by element; -1: an element that has gone, shape (m,)."""
        labels = np.zeros(len(self._volumes), np.int32)
        self.compiled.pieces(labels)
        return labels

    def sub_steps(self, seconds: float) -> int:
        """Return the least number of sub-steps of a step of `seconds`."""
        return ceil(seconds / self.longest_step)

    def advance(
        self,
        seconds: float,
        way: SphereWay,
        friction: float,
        gravity: float,
        drag: float = 0.0,
        every: int = 1,
    ) -> Vector:
        """Advance by `seconds`; return the force on each sphere in each sub-step, N, shape (k, n, 3).

        gravity: along -z, m/s^2. drag: damping over mass, 1/s. every: sub-steps between the forces of the
        elements.
        """
        forces = way.no_forces()
        self.compiled.advance(*self.arguments(seconds, way, forces, friction, gravity, drag, every))
        return forces

    def arguments(
        self,
        seconds: float,
        way: SphereWay,
        forces: Vector,
        friction: float,
        gravity: float,
        drag: float,
        every: int = 1,
    ) -> tuple[Any, ...]:
        """Return the arguments of `_solid.c` for `advance`, which writes `forces`, shape (k, n, 3)."""
        sub_steps, edges = len(way.path) - 1, way.edges
        return (
            way.path,
            self.middle,
            way.radii,
            way.free,
            forces,
            friction,
            seconds / sub_steps,
            sub_steps,
            gravity,
            drag,
            every,
            *(edges.ends, edges.toughness, edges.element, edges.front, edges.ahead, edges.swept),
        )

    def tear(self, stretch: float, toughness: float | None = None) -> int:
        """Tear tissue stretched beyond `stretch`, at the end of a tear by `toughness` (J/m^2), if stated.

        Return how many faces have opened.
        """
        return self.compiled.tear(stretch, toughness or 0.0)

    def remove(self, elements: Indices) -> int:
        """Let elements go; return how many were there."""
        return self.compiled.remove(np.ascontiguousarray(elements, np.int32))

    def hold(self, node: int, sphere: int) -> None:
        """Let a node go with a sphere."""
        self._holder[node], self._inverse_mass[node] = sphere, 0.0

    def let_go(self, node: int) -> None:
        """Let a node, and all nodes cut from it, move freely."""
        nodes = np.flatnonzero((self.origin == self._origin[node]) & (self.holder == self._holder[node]))
        self._holder[nodes] = -1
        free = (self._flags[nodes] & _FIXED == 0) & (self._mass[nodes] > 0.0)
        self._inverse_mass[nodes[free]] = 1.0 / self._mass[nodes[free]]

    def tie(self, pairs: NDArray[np.int32]) -> None:
        """Let pairs of nodes, shape (p, 2), come together and stay together, as far as there is room."""
        first = int((self._ties[:, 0] >= 0).sum())
        room = self._ties[first : first + len(pairs)]
        room[:] = pairs[: len(room)]

    def untie(self) -> None:
        """Let all tied nodes go."""
        self._ties[:] = -1

    @property
    def ties(self) -> NDArray[np.int32]:
        """Pairs of tied nodes, -1 after the last, shape (p, 2)."""
        return self._ties

    def stand(self) -> None:
        """Stop all nodes; viscous strains stay."""
        self._velocity[:] = 0.0

    @property
    def state(self) -> tuple[NDArray[np.generic], ...]:
        """Arrays that change, in the order of `restore`: `counts` gives the shapes of a divided body."""
        n, f = self.compiled.counts
        moving = (self._displacement[:n], self._velocity[:n], self.strains)
        held = (self._holder[:n], self._inverse_mass[:n], *((self._ties,) if len(self._ties) else ()))
        if not self.divisible:
            return *moving, *held
        nodes = (self._rest, self._mass, self._inverse_volume, self._bulk, self._origin, self._flags)
        elements = (self._corners, self._gradients, self._volumes, self._element_mass, self._across)
        return *moving, *held, *(array[:n] for array in nodes), *elements, self._surface[:f], self._owner[:f]

    @property
    def counts(self) -> tuple[int, int]:
        """Numbers of nodes and of faces of the surface."""
        return self.compiled.counts

    @counts.setter
    def counts(self, counts: tuple[int, int]) -> None:
        self.compiled.counts = counts

    def _piece_frequency(self, materials: Sequence[Material]) -> float:
        """Return a bound of the highest natural frequency (rad/s) of every piece of the resting body."""
        mu, lambda_ = (max(one.neo_hookean_lame[k] for one in materials) for k in (0, 1))
        shear = 0.75 * mu * (1.0 + float(self._branch[:, 0].sum()))
        sharpness, bulk_rate = self._limits[1:3].tolist()
        # shear energy G |strain|^2 V, lumped mass rho V / 4
        density = min(one.density for one in materials)
        return sqrt(8.0 * shear * sharpness / density + lambda_ * bulk_rate)

    def _highest_frequency(self) -> float:
        """Return the highest natural frequency (rad/s) at rest, with all branches rigid."""
        size = _PROBE_STRAIN * float(np.ptp(self.nodes, axis=0).max())
        mode = np.random.default_rng(0).standard_normal((len(self.mass), 3))
        square = 0.0
        for _ in range(_POWER_ITERATIONS):
            mode *= size / float(np.abs(mode).max())
            self.displacement[:, :3] = mode
            self.strains[:] = 0.0
            self.compiled.forces(0.0)
            pushed: Vector = -self.force[:, :3].astype(np.float64) * self.inverse_mass[:, None]
            square = float(np.linalg.norm(pushed) / np.linalg.norm(mode))
            mode = pushed
        self._displacement[:] = 0.0
        self.strains[:] = 0.0
        return sqrt(square)


def _edges_of(mesh: TetMesh) -> Vector:
    """Return the edges of all tetrahedra at rest, m, shape (6 m, 3)."""
    pairs = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
    corners = mesh.nodes[mesh.tetrahedra[:, pairs]]
    return (corners[:, :, 1] - corners[:, :, 0]).reshape(-1, 3)


def _in_whole_blocks(mesh: TetMesh) -> tuple[Indices, Vector, Indices]:
    """Return tetrahedra, shape (m, 4), their volumes, m^3, and their numbers in the mesh, shape (m,).

    They fill whole blocks, the last with volume 0. Neighbours in order have neighbouring nodes.
    """
    order = np.argsort(mesh.tetrahedra.min(axis=1), kind="stable")
    missing = -len(order) % _LANES
    order = np.concatenate([order, np.repeat(order[-1:], missing)])
    tetrahedra = mesh.tetrahedra[order]
    volume = volumes(mesh.nodes, tetrahedra)
    volume[len(volume) - missing :] = 0.0
    return tetrahedra, volume, order
