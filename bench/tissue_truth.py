"""The force of tissue on a sphere, converged, by finite elements that are not ours.

python bench/tissue_truth.py law    # the shares in engines/tissue/elasticity/half_space.py
python bench/tissue_truth.py rim    # the shares in engines/tissue/elasticity/rims.py, half an hour of a core
python bench/tissue_truth.py        # bench/tissue_truth.json, half an hour of a core

Quadratic elements of scikit-fem (`pip install scikit-fem`), fine where the sphere touches; Bullet's material;
no friction; contact by a penalty at the points of integration; Newton's method with a line search. The
engine has linear elements of its own, so nothing of it is in these figures but the meshes of its shapes and
the material's energy: Smith, de Goes, Kim, Stable Neo-Hookean Flesh Simulation (ACM Trans. Graph. 37, 2018),
equation 14.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu
from skfem import Basis, ElementTetP2, ElementTriP2, FacetBasis, MeshTet, MeshTri

sys.path.insert(0, str(Path(__file__).parents[1]))

from engines.tissue.elasticity.half_space import DEEPEST, POISSON_RATIOS, sphere_force
from engines.tissue.material import Material
from engines.tissue.meshing.isosurface_stuffing import fill
from engines.tissue.meshing.smoothing import _onto_surface, smoothed
from engines.tissue.organs import kidney, liver
from engines.tissue.organs.catalogue import SHAPES
from engines.tissue.organs.materials import preset
from schemas.vectors import Vector

__all__ = ["Solid", "axisymmetric", "three_dimensional"]

STANDARD_GRAVITY = 9.80665
BLOCK = Material(10e3, 0.4, 1000.0, 0.0)
FINE, REACH, GROWTH = 0.4, 0.4, 1.8
"""Edges are 0.4 radii long within 0.4 radii of the place of the press, and 1.8 of what is beyond."""
SNAPPED_M = 12e-3
"""From that place: how far the surface of an organ is that of its shape."""
AROUND_M = 3e-3
ORGANS: dict[str, Any] = {
    "liver-lobe": (liver, "liver", (-0.050, -0.066, -0.030), (0.050, 0.066, 0.030), 0.0185),
    "kidney-with-adrenal": (kidney, "kidney", (-0.055, -0.030, -0.026), (0.085, 0.030, 0.026), 0.0130),
}
"""Module, material, box and spacing of some 250 nodes."""

DEPTHS_M = (1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3)
LAW_RADIUS_M = 5e-3
LAW_DEPTHS: list[float] = np.arange(0.2, 3.01, 0.2).round(1).tolist()
"""In radii."""

RIM_AWAY, RIM_DEPTHS = (0.0, 0.3, 0.6, 1.0), (0.2, 0.4, 0.6, 0.8, 1.0, 1.2)
"""In radii."""
FAR, NEAR = 60.0, 6.0
"""In radii: the end of a quarter-space, and up to where it may be touched."""

PENALTY = 5e9
"""Pressure (Pa) by a metre that the surface is inside the sphere: 1 um at 5 kPa."""
PERMUTATION = np.array(
    [[[np.linalg.det(np.eye(3)[[i, j, k]]) for k in range(3)] for j in range(3)] for i in range(3)]
)
"""The permutation symbol."""


@dataclass
class Solid:
    """A body of d unknowns for each of its nodes, d = 2 if it is axisymmetric."""

    rest: Vector
    """m, shape (n, d)."""
    dofs: Any
    """Unknowns of each element, shape (e, a)."""
    by_unknown: Vector
    """Derivative of the deformation gradient, by element, point of integration and unknown, (e, q, 9, a)."""
    weights: Vector
    """m^3, shape (e, q)."""
    faces: Any
    """Unknowns of each face that may be touched, shape (f, b)."""
    shapes: Vector
    """Position by unknown on the faces, shape (f, p, d, b)."""
    areas: Vector
    """m^2, shape (f, p)."""
    free: Any
    """The unknowns that are not fixed."""
    material: Material
    load: Vector
    """N, shape (n d,)."""
    copies: float = 1.0
    """How often the body is there: 2 for half of a symmetric one."""
    moved: Vector = field(init=False)
    """Displacements, m, shape (n d,)."""

    def __post_init__(self) -> None:
        self.moved = np.zeros(self.rest.size)
        self._mu, self._lambda = self.material.neo_hookean_lame
        self._alpha = 1.0 + 0.75 * self._mu / self._lambda
        dofs = self.dofs
        self._pairs = tuple(
            np.broadcast_to(x, (*dofs.shape, dofs.shape[1])).ravel()
            for x in (dofs[:, :, None], dofs[:, None])
        )
        self._place = np.full(self.rest.size, -1)
        self._place[self.free] = np.arange(len(self.free))

    def settle(self) -> None:
        """Let it sag."""
        self._balance(None, 1.0)

    def hold(self, unknowns: Any) -> None:
        """Fix these unknowns as well; who moves them in `moved` finds their forces in `residual`."""
        self.free = np.setdiff1d(self.free, unknowns)
        self._place[:] = -1
        self._place[self.free] = np.arange(len(self.free))

    @property
    def residual(self) -> Vector:
        """What holds the fixed unknowns, N, shape (n d,)."""
        return self._state(self.moved, None, 1.0)[1]

    def press(self, centre: Vector, radius: float) -> Vector:
        """Return the force (N) on a sphere at `centre` (m), both of shape (d,)."""
        self._balance(centre, radius)
        return self.copies * self._contact(self.moved, centre, radius)[2]

    def _balance(self, centre: Vector | None, radius: float) -> None:
        value, residual, matrix = self._state(self.moved, centre, radius)
        for _ in range(200):
            free = self.free
            factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
            step = np.zeros(self.moved.size)
            step[free] = factors.solve(-residual[free])
            if step @ residual > 0.0:
                step = -step
            step *= min(1.0, 0.25 * radius / np.abs(step).max())
            length, slope = 1.0, float(step @ residual)
            while (
                length > 1e-4
                and self._energy(self.moved + length * step, centre, radius) > value + 1e-4 * length * slope
            ):
                length *= 0.5
            self.moved = self.moved + length * step
            value, residual, matrix = self._state(self.moved, centre, radius)
            pressed = (
                1e-3 if centre is None else float(np.abs(self._contact(self.moved, centre, radius)[2]).max())
            )
            if (
                np.abs(residual[free]).max() < 1e-6 + 1e-4 * pressed
                and length * np.abs(step).max() < 1e-3 * radius
            ):
                return
        raise RuntimeError(f"no equilibrium: {np.abs(residual[free]).max():.3g} N are left")

    def _energy(self, moved: Vector, centre: Vector | None, radius: float) -> float:
        _, J, trace, _ = self._deformation(moved)
        density = self._mu / 2 * (trace - 3 - np.log(trace + 1)) + self._lambda / 2 * (J - self._alpha) ** 2
        contact = 0.0 if centre is None else self._contact(moved, centre, radius)[0]
        return float((self.weights * density).sum() - self.load @ moved + contact)

    def _deformation(self, moved: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        F = np.eye(3).ravel() + np.einsum("eqxa,ea->eqx", self.by_unknown, moved[self.dofs])
        F = F.reshape(*F.shape[:2], 3, 3)
        cofactor = np.stack([np.cross(F[..., (i + 1) % 3], F[..., (i + 2) % 3]) for i in range(3)], axis=-1)
        J = np.einsum("eqi,eqi->eq", F[..., 0], cofactor[..., 0])
        return F, J, np.einsum("eqij,eqij->eq", F, F), cofactor

    def _state(self, moved: Vector, centre: Vector | None, radius: float) -> tuple[float, Vector, Any]:
        """Return energy (J), residual (N) and stiffness of the free unknowns."""
        F, J, trace, cofactor = self._deformation(moved)
        mu, lambda_, alpha = self._mu, self._lambda, self._alpha
        P = (mu * (1 - 1 / (trace + 1)))[..., None, None] * F + (lambda_ * (J - alpha))[
            ..., None, None
        ] * cofactor
        A = np.einsum("eq,xy->eqxy", mu * (1 - 1 / (trace + 1)), np.eye(9))
        f, g = F.reshape(*J.shape, 9), cofactor.reshape(*J.shape, 9)
        A += (2 * mu / (trace + 1) ** 2)[..., None, None] * f[..., :, None] * f[..., None, :]
        A += lambda_ * g[..., :, None] * g[..., None, :]
        A += (lambda_ * (J - alpha))[..., None, None] * np.einsum(
            "iko,jlp,eqop->eqijkl", PERMUTATION, PERMUTATION, F, optimize=True
        ).reshape(*J.shape, 9, 9)
        B = self.by_unknown
        K = (B.swapaxes(2, 3) @ (self.weights[..., None, None] * A) @ B).sum(axis=1)
        inner = np.einsum("eqxa,eqx->ea", B, self.weights[..., None] * P.reshape(*J.shape, 9))
        residual = np.bincount(self.dofs.ravel(), inner.ravel(), moved.size) - self.load
        rows, columns, values = [self._pairs[0]], [self._pairs[1]], [K.ravel()]
        density = mu / 2 * (trace - 3 - np.log(trace + 1)) + lambda_ / 2 * (J - alpha) ** 2
        energy = float((self.weights * density).sum() - self.load @ moved)
        if centre is not None:
            more, push, _, block, dofs = self._contact(moved, centre, radius)
            energy += more
            residual = residual + push
            shape = (*dofs.shape, dofs.shape[1])
            rows.append(np.broadcast_to(dofs[:, :, None], shape).ravel())
            columns.append(np.broadcast_to(dofs[:, None], shape).ravel())
            values.append(block.ravel())
        i, j = (self._place[np.concatenate(parts)] for parts in (rows, columns))
        here = (i >= 0) & (j >= 0)
        size = len(self.free)
        return (
            energy,
            residual,
            coo_array((np.concatenate(values)[here], (i[here], j[here])), (size, size)).tocsc(),
        )

    def _contact(
        self, moved: Vector, centre: Vector, radius: float
    ) -> tuple[float, Vector, Vector, Vector, Any]:
        """Return energy, force on the unknowns, on the sphere, and the stiffness of the touched faces."""
        points = np.einsum("fpda,fa->fpd", self.shapes, self.rest.ravel()[self.faces] + moved[self.faces])
        away = points - centre
        distance = np.sqrt((away * away).sum(axis=2))
        touched = np.flatnonzero((distance < radius).any(axis=1))
        away, distance, shapes = away[touched], distance[touched], self.shapes[touched]
        depth = np.maximum(radius - distance, 0.0)
        normal = away / distance[..., None]
        pressure = PENALTY * depth * self.areas[touched]
        push = -np.einsum("fpda,fpd->fa", shapes, pressure[..., None] * normal)
        forces = np.bincount(self.faces[touched].ravel(), push.ravel(), moved.size)
        along = np.einsum("fpda,fpd->fpa", shapes, normal)
        rate = PENALTY * self.areas[touched] * (depth > 0.0)
        block = np.einsum("fp,fpa,fpb->fab", rate, along, along)
        on_sphere = -np.einsum("fp,fpd->d", pressure, normal)
        energy = 0.5 * PENALTY * float((self.areas[touched] * depth**2).sum())
        return energy, forces, on_sphere, block, self.faces[touched]


def _interleaved(element_dofs: Any, d: int) -> Any:
    """Return the unknowns of elements, (e, a d), from the numbers of their nodes, (a, e)."""
    return (d * element_dofs.T[:, :, None] + np.arange(d)).reshape(element_dofs.shape[1], -1)


def _gradients(basis: Any) -> Vector:
    """Return the gradients of the shape functions, (e, q, a, d)."""
    return np.stack([part[0].grad for part in basis.basis]).transpose(2, 3, 0, 1)


def _values(basis: Any) -> Vector:
    """Return the shape functions on the faces, (f, p, a)."""
    return np.stack([np.broadcast_to(part[0].value, basis.dx.shape) for part in basis.basis]).transpose(
        1, 2, 0
    )


def _mass(basis: Any, around: Vector) -> Vector:
    """Return the volume of each node (m^3)."""
    parts = np.einsum("eqa,eq->ae", _values(basis), basis.dx * around)
    return np.bincount(basis.element_dofs.ravel(), parts.ravel(), basis.N)


def _solid(
    basis: Any, sides: Any, by_unknown: Vector, scale: tuple[Vector, Vector], material: Material, **rest: Any
) -> Solid:
    values, d = _values(sides), len(basis.doflocs)
    shapes = np.einsum("fpa,xy->fpxay", values, np.eye(d)).reshape(*values.shape[:2], d, -1)
    fixed = rest.pop("fixed")
    return Solid(
        basis.doflocs.T.copy(),
        _interleaved(basis.element_dofs, d),
        by_unknown,
        basis.dx * scale[0],
        _interleaved(sides.element_dofs, d),
        shapes,
        sides.dx * scale[1],
        np.flatnonzero(~fixed.ravel()),
        material,
        **rest,
    )


def three_dimensional(
    mesh: MeshTet, top: Any, fixed: Any, material: Material, gravity: float, copies: float = 1.0
) -> Solid:
    """Return a body of quadratic tetrahedra.

    Args:
        mesh: its vertices, m.
        top: the numbers of the facets that may be touched.
        fixed: from positions (m, shape (n, 3)) to which of their coordinates are fixed, shape (n, 3).
        material: of the tissue.
        gravity: along -z, m/s^2.
        copies: see `Solid`.
    """
    basis = Basis(mesh, ElementTetP2(), intorder=2)
    sides = FacetBasis(mesh, ElementTetP2(), facets=top, intorder=6)
    grads = _gradients(basis)
    e, q, a, _ = grads.shape
    by_unknown = np.zeros((e, q, 3, 3, a, 3))
    for i in range(3):
        by_unknown[:, :, i, :, :, i] = grads.swapaxes(2, 3)
    load = np.zeros((basis.N, 3))
    load[:, 2] = -material.density * gravity * _mass(basis, np.ones(1))
    return _solid(
        basis,
        sides,
        by_unknown.reshape(e, q, 9, -1),
        (np.ones(1), np.ones(1)),
        material,
        fixed=fixed(basis.doflocs.T),
        load=load.ravel(),
        copies=copies,
    )


def axisymmetric(mesh: MeshTri, material: Material, gravity: float = 0.0) -> Solid:
    """Return a body of revolution, (r, z) the coordinates of the mesh, pressed above.

    It is held below, and without gravity, as a half-space, outside too.
    """
    basis = Basis(mesh, ElementTriP2(), intorder=4)
    top = mesh.facets_satisfying(lambda x: np.abs(x[1]) < 1e-12)
    sides = FacetBasis(mesh, ElementTriP2(), facets=top, intorder=6)
    grads = _gradients(basis)
    e, q, a, _ = grads.shape
    around = 2.0 * np.pi * basis.global_coordinates().value[0]
    values = _values(basis)
    by_unknown = np.zeros((e, q, 3, 3, a, 2))  # components r, z, around
    for i in range(2):
        for j in range(2):
            by_unknown[:, :, i, j, :, i] = grads[..., j]
    by_unknown[:, :, 2, 2, :, 0] = values * (2.0 * np.pi / around)[..., None]
    r, z = basis.doflocs
    outside = z < z.min() + 1e-9
    if not gravity:
        outside |= r > r.max() - 1e-9
    load = np.zeros((basis.N, 2))
    load[:, 1] = -material.density * gravity * _mass(basis, around)
    return _solid(
        basis,
        sides,
        by_unknown.reshape(e, q, 9, -1),
        (around, 2.0 * np.pi * sides.global_coordinates().value[0]),
        material,
        fixed=np.stack([outside | (r < 1e-9), outside], axis=1),
        load=load.ravel(),
    )


def graded(least: float, end: float, growth: float, fine_to: float) -> Vector:
    """Return coordinates from 0 to `end`: `least` apart up to `fine_to`, then ever farther by `growth`."""
    points, step = [0.0], least
    while points[-1] < end:
        points.append(points[-1] + step)
        if points[-1] > fine_to:
            step *= growth
    return np.array(points) * end / points[-1]


def refined(mesh: MeshTet, at: Vector, least: float, reach: float) -> MeshTet:
    """Return the mesh with edges of `least` (m) within `reach` (m) of a point, and longer ones beyond."""
    while True:
        corners = mesh.p[:, mesh.t]
        longest = np.max(
            [np.linalg.norm(corners[:, i] - corners[:, j], axis=0) for i in range(4) for j in range(i)],
            axis=0,
        )
        away = np.linalg.norm(corners - at[:, None, None], axis=0).min(axis=0)
        coarse = np.flatnonzero(longest > np.maximum(least, GROWTH * (away - reach)))
        if not len(coarse):
            return mesh
        mesh = mesh.refined(coarse)


@dataclass(frozen=True)
class Body:
    """Where to press what."""

    solid: Solid
    point: Vector
    """Of the surface at rest, m."""
    inward: Vector
    """The normal there."""
    from_rest: bool = True
    """Whether depths count from the surface at rest, along its normal; else from where it hangs."""

    def press(self, radius: float, depths: Sequence[float]) -> Iterator[float]:
        """Yield the force (N) along the normal at every depth (m)."""
        self.solid.settle()
        start, inward = (self.point, self.inward) if self.from_rest else self.settled
        at = 0.0
        for depth in depths:
            while at < depth - 1e-9:
                at = min(at + (0.25 if at < 1.5 * radius else 0.1) * radius, depth)
                force = self.solid.press(start + (at - radius) * inward, radius)
            yield -float(force @ inward)

    @property
    def settled(self) -> tuple[Vector, Vector]:
        """The point where gravity alone has brought it, m, and the normal there, once the solid has settled.

        The normal is that of the plane through the nodes of the surface around.
        """
        rest, nodes = self.solid.rest, self.solid.rest + self.solid.moved.reshape(self.solid.rest.shape)
        away = np.linalg.norm(rest - self.point, axis=1)
        surface = np.unique(self.solid.faces // 3)
        around = nodes[surface[away[surface] < AROUND_M]]
        normal = np.linalg.svd(around - around.mean(axis=0))[2][2]
        return nodes[away.argmin()], normal * np.sign(normal @ self.inward)


def middle_of_block(radius: float) -> Body:
    """Return a disc with the thickness of the block and its area: alike, far from the sides."""
    r, z = (graded(0.12, end / radius, 1.35, 1.5) * radius for end in (39.1e-3, 20e-3))
    solid = axisymmetric(MeshTri.init_tensor(r, -z[::-1]), BLOCK, STANDARD_GRAVITY)
    return Body(solid, np.zeros(2), np.array([0.0, -1.0]))


def side_of_block(radius: float, x: float) -> Body:
    """Return half of the block, pressed at (x, 0), x in m."""
    mesh = MeshTet.init_tensor(np.linspace(-0.04, 0.04, 5), np.linspace(0, 0.03, 3), np.linspace(-0.02, 0, 2))
    at = np.array([x, 0.0, 0.0])
    mesh = refined(mesh, at, FINE * radius, REACH * radius)
    top = mesh.facets_satisfying(
        lambda x: (np.abs(x[2]) < 1e-9) | (np.abs(x[0]) > 0.04 - 1e-9), boundaries_only=True
    )

    def fixed(points: Vector) -> Any:
        below, cut = points[:, 2] < -0.02 + 1e-9, np.abs(points[:, 1]) < 1e-9
        return np.stack([below, below | cut, below], axis=1)

    return Body(
        three_dimensional(mesh, top, fixed, BLOCK, STANDARD_GRAVITY, 2.0), at, np.array([0.0, 0.0, -1.0])
    )


def quarter_space(away: float) -> Solid:
    """Return half of a quarter-space without weight, pressed at the origin, `away` (m) from its rim."""
    far = FAR * LAW_RADIUS_M
    x, y = np.linspace(away - far, away, 3), np.linspace(0.0, far, 3)
    mesh = refined(
        MeshTet.init_tensor(x, y, -y[::-1]), np.zeros(3), FINE * LAW_RADIUS_M, REACH * LAW_RADIUS_M
    )
    top = mesh.facets_satisfying(lambda x: (np.abs(x[2]) < 1e-9) | (x[0] > away - 1e-9), boundaries_only=True)
    middles = mesh.p[:, mesh.facets[:, top]].mean(axis=1)
    top = top[np.linalg.norm(middles, axis=0) < NEAR * LAW_RADIUS_M]

    def fixed(points: Vector) -> Any:
        outside = (
            (points[:, 2] < 1e-9 - far) | (points[:, 0] < away - far + 1e-9) | (points[:, 1] > far - 1e-9)
        )
        return np.stack([outside, outside | (np.abs(points[:, 1]) < 1e-9), outside], axis=1)

    return three_dimensional(mesh, top, fixed, BLOCK, 0.0, 2.0)


def organ(shape: str, x: float, y: float, radius: float) -> Body:
    """Return an organ, pressed on its upper side at (x, y) in m of its body before that is given its form.

    Its surface is that of the shape where it is fine, and that of a mesh of some 250 nodes elsewhere.
    """
    module, material, low, high, spacing = ORGANS[shape]
    coarse = fill(module._field, np.array(low), np.array(high), spacing)
    thick = smoothed(coarse, module._field, spacing)
    heights = np.linspace(0.0, high[2], 2001)
    column = np.stack([np.full(2001, x), np.full(2001, y), heights], axis=1)
    top = column[np.flatnonzero(module._field(column) > 0.0)[-1]]
    mesh = refined(
        MeshTet(thick.nodes.T.copy(), thick.tetrahedra.T.copy()), top, FINE * radius, REACH * radius
    )
    points = mesh.p.T.copy()
    near = np.unique(mesh.facets[:, mesh.boundary_facets()])
    near = near[np.linalg.norm(points[near] - top, axis=1) < SNAPPED_M]
    points[near] = _onto_surface(module._field, points[near])
    formed = MeshTet(module._formed(points).T.copy(), mesh.t)
    site = module._formed(np.stack(np.array([top])))
    nearest = near[np.linalg.norm(formed.p.T[near] - site[0], axis=1).argmin()]
    site = formed.p.T[nearest]
    ahead = _onto_surface(
        module._field, np.stack([points[nearest] + [1e-4, 0, 0], points[nearest] + [0, 1e-4, 0]])
    )
    edges = module._formed(ahead) - site
    normal = np.cross(edges[0], edges[1])
    inward = -normal / np.linalg.norm(normal)
    shape_ = SHAPES[shape]
    surface = np.unique(formed.facets[:, formed.boundary_facets()])
    anchored = np.zeros(formed.p.shape[1], bool)
    for part in shape_.anchors:
        anchored[surface] |= shape_.surface(part, formed.p.T[surface])
    loose = [f for f in formed.boundary_facets() if not anchored[formed.facets[:, f]].all()]
    tied = formed.facets[:, [f for f in formed.boundary_facets() if anchored[formed.facets[:, f]].all()]]
    known = preset(material)
    elastic = Material(known.young_modulus, known.poisson_ratio, known.density, 0.0)

    def fixed(nodes: Vector) -> Any:
        """Vertices that are anchored, and the middles of edges of faces whose corners are."""
        corners = formed.p.T[tied]  # (3, t, 3)
        middles = np.concatenate([0.5 * (corners[i] + corners[(i + 1) % 3]) for i in range(3)])
        held = np.round(np.concatenate([formed.p.T[anchored], middles]), 9)
        where = {tuple(point) for point in held.tolist()}
        these = np.array([tuple(point) in where for point in np.round(nodes, 9).tolist()])
        return np.repeat(these[:, None], 3, axis=1)

    return Body(
        three_dimensional(formed, np.array(loose), fixed, elastic, STANDARD_GRAVITY), site, inward, False
    )


def law(poisson_ratio: float) -> Iterator[float]:
    """Yield the share of Hertz's force for a half-space at every depth of `LAW_DEPTHS`."""
    r = graded(0.1, 100.0, 1.35, 1.5) * LAW_RADIUS_M
    solid = axisymmetric(MeshTri.init_tensor(r, -r[::-1]), Material(10e3, poisson_ratio, 1000.0, 0.0))
    for depth in LAW_DEPTHS:
        force = float(solid.press(np.array([0.0, LAW_RADIUS_M * (1.0 - depth)]), LAW_RADIUS_M)[1])
        yield force / (4.0 / 3.0 * 10e3 / (1.0 - poisson_ratio**2) * LAW_RADIUS_M**2 * depth**1.5)


def print_law() -> None:
    """Print the table of engines/tissue/elasticity/half_space.py."""
    shares = [list(law(nu)) for nu in POISSON_RATIOS]
    for depth, row in zip(LAW_DEPTHS, zip(*shares, strict=True), strict=True):
        print(f"[{depth:.2f}, {', '.join(f'{share:.4f}' for share in row)}],", flush=True)


def print_rim() -> None:
    """Print the table of engines/tissue/elasticity/rims.py."""
    for away in RIM_AWAY:
        solid, at, shares = quarter_space(away * LAW_RADIUS_M), 0.0, list[str]()
        for depth in RIM_DEPTHS:
            while at < depth - 1e-9:
                at = min(at + 0.25, depth)
                force = solid.press(np.array([0.0, 0.0, LAW_RADIUS_M * (1.0 - at)]), LAW_RADIUS_M)[2]
            whole = sphere_force(np.array([depth * LAW_RADIUS_M]), LAW_RADIUS_M, BLOCK)[0]
            shares.append(f"{force / whole:.4f}")
        print(f"[{', '.join(shares)}],  # {away:g} radii away", flush=True)


def study() -> Iterator[tuple[str, str, Body, float]]:
    """Yield name, title, body and radius (m) of every press."""
    for radius in (2e-3, 3e-3, 4e-3, 5e-3):
        yield "middle", "block, middle", middle_of_block(radius), radius
    yield "side", "block, 8 mm from its side", side_of_block(5e-3, 0.032), 5e-3
    yield "rim-5", "block, 5 mm from its side", side_of_block(5e-3, 0.035), 5e-3
    yield "rim", "block, 3 mm from its side", side_of_block(5e-3, 0.037), 5e-3
    yield "rim-1.5", "block, 1.5 mm from its side", side_of_block(5e-3, 0.0385), 5e-3
    yield "liver", "liver", organ("liver-lobe", 0.02, 0.0, 5e-3), 5e-3
    yield "kidney", "kidney", organ("kidney-with-adrenal", 0.0, 0.0, 5e-3), 5e-3


def write(path: Path) -> None:
    """Write the forces of all presses, and print them."""
    found: dict[str, Any] = {}
    for name, title, body, radius in study():
        depths = [depth for depth in DEPTHS_M if depth <= DEEPEST * radius]
        forces = [round(force, 5) for force in body.press(radius, depths)]
        print(f"{title}, {radius * 1e3:g} mm: {forces} N", flush=True)
        point = np.zeros(3) if name == "middle" else body.point
        row = found.setdefault(name, {"title": title, "point_m": np.round(point, 6).tolist(), "force_n": {}})
        row["force_n"][f"{radius * 1e3:g}"] = forces
    path.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["law"]:
            print_law()
        case ["rim"]:
            print_rim()
        case _:
            write(Path(__file__).parent / "tissue_truth.json")
