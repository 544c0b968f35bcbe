"""A soft body of linear tetrahedra in explicit dynamics; `_solid.c` steps it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, sqrt
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices, TetMesh, volumes
from schemas.errors import ScenarioError
from schemas.vectors import Vector

__all__ = ["Branch", "Solid", "SphereWay"]

_Number = TypeVar("_Number", bound=np.generic)

_LANES = 4
"""Elements of a block, as in `_lanes.h`."""
_ALIGNMENT = 16
"""Bytes: loads of four numbers at once need it."""
_STEP_SHARE = 0.7
"""Sub-step over the longest stable one of the resting mesh, 2 / highest frequency: a compressed mesh is
stiffer.
"""
_POWER_ITERATIONS = 80
_PROBE_STRAIN = 1e-4
"""Size of the displacements that measure the stiffness, in the body's extent."""


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


class Solid:
    """Arrays of the body, in single precision and blocks of elements, relative to the middle of the body.

    Raises ScenarioError where `_solid.c` was not compiled.
    """

    def __init__(
        self,
        mesh: TetMesh,
        anchored: NDArray[np.bool_],
        faces: Indices,
        material: Material,
        branches: Sequence[Branch] = (),
    ) -> None:
        """`anchored`: fixed nodes, shape (n,); `faces`: what spheres touch, shape (f, 3)."""
        try:
            from engines.fem._solid import Solid as Compiled
        except ImportError as error:
            raise ScenarioError(
                "kind fem needs its part in C, which was not built: install a wheel for this platform, or"
                " install from the sources with a C compiler; or take kind bullet"
            ) from error
        self.middle: Vector = 0.5 * (mesh.nodes.min(axis=0) + mesh.nodes.max(axis=0))
        """Origin of the arrays in `world`, m."""
        self._rest = mesh.nodes
        tetrahedra = _by_place(mesh)
        blocks = -(-len(tetrahedra) // _LANES)
        missing = blocks * _LANES - len(tetrahedra)
        tetrahedra = np.concatenate([tetrahedra, np.repeat(tetrahedra[-1:], missing, axis=0)])
        volume = volumes(mesh.nodes, tetrahedra)
        volume[len(volume) - missing :] = 0.0
        around = np.bincount(tetrahedra.ravel(), np.repeat(volume, 4), len(mesh.nodes))
        edges = mesh.nodes[tetrahedra[:, 1:]] - mesh.nodes[tetrahedra[:, :1]]
        gradients: Vector = np.asarray(np.linalg.inv(edges), np.float64).transpose(0, 2, 1).reshape(-1, 9)
        mu, lambda_ = material.neo_hookean_lame
        n = len(mesh.nodes)
        self.mass = _floats(material.density * around / 4.0)
        """kg, shape (n,)."""
        self.displacement, self.velocity, self.force = (_floats(np.zeros((n, 4))) for _ in range(3))
        """m and pressure (Pa), m/s, N: shape (n, 4)."""
        self.inverse_mass = _floats(np.where(anchored, 0.0, 4.0 / (material.density * around)))
        """1/kg, 0 for fixed and held nodes, shape (n,)."""
        self.holder = _integers(np.full(n, -1))
        """Number of the sphere that holds a node, or -1, shape (n,)."""
        self.strains = _floats(np.zeros((len(branches), blocks, 6, _LANES)))
        """Viscous strains."""
        branch = _floats(np.array([[one.share, one.seconds] for one in branches]).reshape(-1, 2))
        self._arrays = (
            _floats(np.concatenate([mesh.nodes - self.middle, np.zeros((n, 1))], axis=1)),
            self.displacement,
            self.velocity,
            self.force,
            self.inverse_mass,
            _floats(1.0 / around),
            _floats(np.full(n, lambda_)),
            self.holder,
            _integers(_in_blocks(tetrahedra)),
            _floats(_in_blocks(gradients)),
            _floats(volume),
            _floats(np.full(len(tetrahedra), mu)),
            self.strains,
            branch,
            _integers(faces),
        )
        self._compiled = Compiled(self._arrays)
        self.longest_step = _STEP_SHARE * 2.0 / self._highest_frequency()
        """Longest sub-step, s."""

    @property
    def elements(self) -> tuple[Indices, Vector, Vector]:
        """Corners, gradients and volumes of the elements at rest, in the order of the blocks.

        Shapes (m, 4); (m, 9), 1/m, of the shape functions of corners 1 to 3; (m,), m^3. An element that fills
        up the last block has no volume.
        """
        corners, gradients, volume = self._arrays[8:11]
        return (
            _by_element(corners).astype(np.int64),
            _by_element(gradients).astype(np.float64),
            volume.astype(np.float64),
        )

    @property
    def nodes(self) -> Vector:
        """Present nodes, m, in `world`, shape (n, 3)."""
        return self._rest + self.displacement[:, :3]

    def sub_steps(self, seconds: float) -> int:
        """Return the least number of sub-steps of a step of `seconds`."""
        return ceil(seconds / self.longest_step)

    def advance(
        self, seconds: float, way: SphereWay, friction: float, gravity: float, drag: float = 0.0
    ) -> Vector:
        """Advance by `seconds`; return the force on each sphere in each sub-step, N, shape (k, n, 3).

        gravity: along -z, m/s^2. drag: damping over mass, 1/s.
        """
        sub_steps, spheres = len(way.path) - 1, way.path.shape[1]
        forces = np.zeros((sub_steps, spheres, 3))
        self._compiled.advance(
            np.ascontiguousarray(way.path - self.middle),
            way.radii,
            way.free,
            forces,
            friction,
            self.mass,
            seconds / sub_steps,
            sub_steps,
            gravity,
            drag,
        )
        return forces

    def stand(self) -> None:
        """Stop all nodes; viscous strains stay."""
        self.velocity[:] = 0.0

    @property
    def state(self) -> tuple[NDArray[np.float32], ...]:
        """Displacements, velocities, and viscous strains."""
        return self.displacement, self.velocity, self.strains

    def _highest_frequency(self) -> float:
        """Return the highest natural frequency (rad/s) at rest, with all branches rigid."""
        size = _PROBE_STRAIN * float(np.ptp(self._rest, axis=0).max())
        mode = np.random.default_rng(0).standard_normal((len(self._rest), 3))
        square = 0.0
        for _ in range(_POWER_ITERATIONS):
            mode *= size / float(np.abs(mode).max())
            self.displacement[:, :3] = mode
            self.strains[:] = 0.0
            self._compiled.forces(0.0)
            pushed: Vector = -self.force[:, :3].astype(np.float64) * self.inverse_mass[:, None]
            square = float(np.linalg.norm(pushed) / np.linalg.norm(mode))
            mode = pushed
        self.displacement[:] = 0.0
        self.strains[:] = 0.0
        return sqrt(square)


def _by_place(mesh: TetMesh) -> Indices:
    """Return the tetrahedra in an order in which neighbours have neighbouring nodes, shape (m, 4)."""
    return mesh.tetrahedra[np.argsort(mesh.tetrahedra.min(axis=1), kind="stable")]


def _in_blocks(values: NDArray[_Number]) -> NDArray[_Number]:
    """Return rows of one element each as blocks with the elements in lanes, shape (b, columns, lanes)."""
    return values.reshape(-1, _LANES, values.shape[1]).transpose(0, 2, 1)


def _by_element(blocks: NDArray[_Number]) -> NDArray[_Number]:
    """Undo `_in_blocks`."""
    return blocks.transpose(0, 2, 1).reshape(-1, blocks.shape[1])


def _floats(values: NDArray[np.floating[Any]] | Indices) -> NDArray[np.float32]:
    """Return an aligned copy in single precision."""
    found = _memory(4 * values.size).view(np.float32).reshape(values.shape)
    found[...] = values
    return found


def _integers(values: Indices) -> NDArray[np.int32]:
    """Return an aligned copy in 32 bits."""
    found = _memory(4 * values.size).view(np.int32).reshape(values.shape)
    found[...] = values
    return found


def _memory(size: int) -> NDArray[np.uint8]:
    """Return `size` bytes that begin at a multiple of `_ALIGNMENT`."""
    memory = np.zeros(size + _ALIGNMENT, np.uint8)
    start = -memory.ctypes.data % _ALIGNMENT
    return memory[start : start + size]
