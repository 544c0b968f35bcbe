"""The reference for Bullet's tissue: its neo-Hookean material on linear tetrahedra, at static equilibrium.

It is written from the paper. Energy density of Smith, de Goes, Kim, Stable Neo-Hookean Flesh Simulation
(2018), equation 14, with a = 1 + 3 mu / (4 lambda): mu/2 (I_C - 3) + lambda/2 (J - a)^2 - mu/2 log(I_C + 1).
Its derivative by F, times the gradients of the shape functions, is the force that the elements exert on the
nodes. Rigid spheres press on the faces between the nodes, so the reference is what this mesh can represent;
how far the mesh is from the continuum is another question, which a finer mesh answers. Friction is Coulomb's,
as a potential of the displacement since the last step with the pressure of the iteration before: Li et al.,
Incremental Potential Contact (ACM Trans. Graph. 39, 2020), section 5.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

PENALTY = 1e5
"""Contact stiffness, N/m: at 1 N on one face the sphere is 10 um inside."""
STICKING = 2e-6
"""Way up to which contacts stick, m."""
FRICTION_ROUNDS = 2
LEVI_CIVITA = np.array(
    [[[np.linalg.det(np.eye(3)[[i, j, k]]) for k in range(3)] for j in range(3)] for i in range(3)]
)


class Elements:
    """Linear tetrahedra of a stable neo-Hookean material; `mu` and `lambda_` (Pa) are those of the paper."""

    def __init__(self, rest, tetrahedra, mu, lambda_):
        inverse = np.linalg.inv((rest[tetrahedra[:, 1:]] - rest[tetrahedra[:, :1]]).transpose(0, 2, 1))
        self.tetrahedra, self.mu, self.lambda_ = tetrahedra, mu, lambda_
        self.volume = 1 / np.linalg.det(inverse) / 6
        self.gradients = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)  # (m, 4, 3)
        self.alpha = 1 + 3 * mu / (4 * lambda_)

    def deformation(self, nodes):
        F = np.einsum("mai,maj->mij", nodes[self.tetrahedra], self.gradients)
        return F, np.linalg.det(F), np.einsum("mij,mij->m", F, F)

    def energy(self, nodes):
        """Return the elastic energy (J), up to a constant; infinite where an element is inverted."""
        _, J, trace = self.deformation(nodes)
        density = self.mu / 2 * (trace - 3 - np.log(trace + 1)) + self.lambda_ / 2 * (J - self.alpha) ** 2
        return float(self.volume @ density) if (J > 0).all() else np.inf

    def forces(self, nodes):
        """Return the elastic force (N) on every node, shape (n, 3)."""
        F, J, trace = self.deformation(nodes)
        cofactor = J[:, None, None] * np.linalg.inv(F).transpose(0, 2, 1)
        P = (
            self.mu * F * (1 - 1 / (trace + 1))[:, None, None]
            + self.lambda_ * (J - self.alpha)[:, None, None] * cofactor
        )
        forces = np.zeros_like(nodes)
        np.add.at(forces, self.tetrahedra, -np.einsum("m,mij,maj->mai", self.volume, P, self.gradients))
        return forces

    def stiffness(self, nodes):
        """Return the second derivative of the energy (N/m), shape (m, 4, 3, 4, 3)."""
        F, J, trace = self.deformation(nodes)
        cofactor = J[:, None, None] * np.linalg.inv(F).transpose(0, 2, 1)
        one = np.einsum("ik,jl->ijkl", np.eye(3), np.eye(3))
        A = np.multiply.outer(self.mu * (1 - 1 / (trace + 1)), one)
        A += np.einsum("m,mij,mkl->mijkl", 2 * self.mu / (trace + 1) ** 2, F, F) + self.lambda_ * np.einsum(
            "mij,mkl->mijkl", cofactor, cofactor
        )
        A += np.einsum(
            "m,iko,jlp,mop->mijkl",
            self.lambda_ * (J - self.alpha),
            LEVI_CIVITA,
            LEVI_CIVITA,
            F,
            optimize=True,
        )
        return np.einsum(
            "m,maj,mijkl,mbl->maibk", self.volume, self.gradients, A, self.gradients, optimize=True
        )


class Body:
    """An organ at rest under its own weight: a mesh whose nodes, as in Bullet, all have the same mass."""

    def __init__(self, organ, gravity=9.80665, friction=None):
        """Take an OrganParams, and its coefficient of friction if it shall be another one."""
        self.friction = organ.friction if friction is None else friction
        mesh = organ.rest
        self.elements = Elements(mesh.nodes, mesh.tetrahedra, *organ.elastic.neo_hookean_lame)
        self.fixed = np.any(list(organ.anchored_nodes.values()), axis=0)
        self.faces = mesh.triangles[~self.fixed[mesh.triangles].all(axis=1)]
        self.load = np.zeros_like(mesh.nodes)
        self.load[:, 2] = -organ.elastic.density * mesh.volume / len(mesh.nodes) * gravity
        self.centres = None
        self.nodes, _ = equilibrium(self.elements, mesh.nodes, self.fixed, self.load)

    def press(self, centres, radii):
        """Return the force (N) on each sphere, shape (k, 3), with the spheres at `centres` (m), shape (k, 3).

        They come straight from where they were last (at first, from 2 mm above), in steps of at most a
        quarter of the least radius, or else they may pass through a face.
        """
        centres = np.asarray(centres, float)
        start = centres + np.array([0.0, 0.0, 2e-3]) if self.centres is None else self.centres
        steps = max(1, int(np.ceil(np.abs(centres - start).max() / (min(radii) / 4))))
        way = (centres - start) / steps
        for i in range(steps):
            before, self.centres = self.nodes, start + (i + 1) * way
            contacts = Contacts.of(before, self.faces, self.centres - way, radii)
            for _ in range(FRICTION_ROUNDS if self.friction else 1):
                rub = Friction(contacts, before, way, self.friction)
                self.nodes, contacts = equilibrium(
                    self.elements, self.nodes, self.fixed, self.load, self.faces, self.centres, radii, rub
                )
        return contacts.on_spheres(len(centres)) + rub.on_spheres(self.nodes, len(centres))

    def reaction(self, nodes):
        """Return the force (N) of the anchors on the tissue, beyond its weight, with its nodes at `nodes`.

        The result has shape (3,).
        """
        return -self.elements.forces(nodes)[self.fixed].sum(axis=0) + self.load[~self.fixed].sum(axis=0)


def internal_forces(rest, tetrahedra, nodes, mu, lambda_):
    """Return the elastic force (N) on every node, shape (n, 3)."""
    return Elements(rest, tetrahedra, mu, lambda_).forces(nodes)


def energy(rest, tetrahedra, nodes, mu, lambda_):
    """Return the elastic energy (J), up to a constant."""
    return Elements(rest, tetrahedra, mu, lambda_).energy(nodes)


def closest(point, corners):
    """Return barycentric coordinates (f, 3) of the points of triangles (f, 3, 3) nearest to `point`.

    The nearest point is the best of face, edges and corners.
    """
    a, b, c = corners.transpose(1, 0, 2)
    edges = np.stack([b - a, c - a], axis=2)
    inner = np.linalg.pinv(edges) @ (point - a)[:, :, None]
    candidates = [np.concatenate([1 - inner.sum(axis=1), inner[:, :, 0]], axis=1)]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        way = corners[:, j] - corners[:, i]
        along = np.clip(
            np.einsum("fi,fi->f", point - corners[:, i], way) / np.einsum("fi,fi->f", way, way), 0, 1
        )
        candidates.append(np.zeros((len(corners), 3)))
        candidates[-1][:, i], candidates[-1][:, j] = 1 - along, along
    weights = np.stack(candidates)
    distances = np.linalg.norm(np.einsum("kfi,fij->kfj", weights, corners) - point, axis=2)
    distances[0, (candidates[0] < 0).any(axis=1)] = np.inf
    return weights[distances.argmin(axis=0), np.arange(len(corners))]


@dataclass
class Contacts:
    """Faces that spheres have entered.

    `nodes` and `weights` (c, 3) of the touched points, `normals` (c, 3) out of the sphere, `depths` (c,),
    `sphere` (c,).
    """

    nodes: np.ndarray
    weights: np.ndarray
    normals: np.ndarray
    depths: np.ndarray
    sphere: np.ndarray

    @classmethod
    def of(cls, nodes, faces, centres, radii):
        rows = []
        for sphere, (centre, radius) in enumerate(zip(centres, radii, strict=True)):
            near = faces[(np.abs(nodes[faces] - centre).min(axis=1) <= radius + 0.02).all(axis=1)]
            weights = closest(centre, nodes[near])
            away = np.einsum("fi,fij->fj", weights, nodes[near]) - centre
            distance = np.linalg.norm(away, axis=1)
            touch = distance < radius
            rows.append(
                (
                    near[touch],
                    weights[touch],
                    away[touch] / distance[touch, None],
                    radius - distance[touch],
                    np.full(touch.sum(), sphere),
                )
            )
        return cls(*(np.concatenate(parts) for parts in zip(*rows, strict=True)))

    @property
    def energy(self):
        return PENALTY / 2 * self.depths @ self.depths

    def forces(self, like):
        """Return the force on every node, shape of `like`."""
        forces = np.zeros_like(like)
        np.add.at(
            forces, self.nodes, PENALTY * np.einsum("c,cj,ca->caj", self.depths, self.normals, self.weights)
        )
        return forces

    def on_spheres(self, count):
        """Return the force (N) on every sphere, shape (count, 3)."""
        forces = np.zeros((count, 3))
        np.add.at(forces, self.sphere, -PENALTY * self.depths[:, None] * self.normals)
        return forces

    @property
    def stiffness(self):
        """Shape (c, 3, 3, 3, 3)."""
        return PENALTY * np.einsum(
            "ca,ci,cb,cj->caibj", self.weights, self.normals, self.weights, self.normals
        )


class Friction:
    """Coulomb friction of `contacts` while nodes come from `before` and spheres go `way` (k, 3)."""

    def __init__(self, contacts, before, way, coefficient):
        self.nodes, self.weights, self.sphere = contacts.nodes, contacts.weights, contacts.sphere
        self.largest = coefficient * PENALTY * contacts.depths
        self.tangents = np.eye(3) - contacts.normals[:, :, None] * contacts.normals[:, None]  # (c, 3, 3)
        self.origins = (
            np.einsum("ca,caj->cj", self.weights, before[self.nodes]) + np.reshape(way, (-1, 3))[self.sphere]
        )

    def slip(self, nodes):
        """Return the slip of the touched points (c, 3), and the friction for each metre of it (c,)."""
        slip = np.einsum(
            "cij,cj->ci",
            self.tangents,
            np.einsum("ca,caj->cj", self.weights, nodes[self.nodes]) - self.origins,
        )
        size = np.linalg.norm(slip, axis=1)
        return slip, self.largest * np.where(
            size < STICKING, 2 / STICKING - size / STICKING**2, 1 / np.maximum(size, STICKING)
        )

    def energy(self, nodes):
        y = np.linalg.norm(self.slip(nodes)[0], axis=1)
        return self.largest @ np.where(
            y < STICKING, y**2 / STICKING - y**3 / (3 * STICKING**2), y - STICKING / 3
        )

    def forces(self, nodes):
        slip, rate = self.slip(nodes)
        forces = np.zeros_like(nodes)
        np.add.at(forces, self.nodes, -np.einsum("c,cj,ca->caj", rate, slip, self.weights))
        return forces

    def on_spheres(self, nodes, count):
        slip, rate = self.slip(nodes)
        forces = np.zeros((count, 3))
        np.add.at(forces, self.sphere, rate[:, None] * slip)
        return forces

    def stiffness(self, nodes):
        slip, rate = self.slip(nodes)
        size = np.linalg.norm(slip, axis=1)
        along = slip / np.maximum(size, 1e-12)[:, None]
        # along the slip: all of it once that slides
        less = self.largest * np.where(size < STICKING, size / STICKING**2, 1 / np.maximum(size, STICKING))
        matrices = (
            rate[:, None, None] * self.tangents - less[:, None, None] * along[:, :, None] * along[:, None]
        )
        return np.einsum("ca,cij,cb->caibj", self.weights, matrices, self.weights)


def equilibrium(
    elements, nodes, fixed, load, faces=None, centres=(), radii=(), friction=None, iterations=100
):
    """Return nodes (n, 3) and contacts at rest, starting from `nodes`; the `fixed` ones (n,) do not move.

    Newton's method with a line search on the total energy, halving while that gains. load: force (N) on the
    nodes, such as their weight, shape (n, 3). Where a sphere slides over the edges of faces the energy has
    kinks, so a residual of 1 mN and half a percent of the spheres' force may be left on a node.
    """
    free = np.flatnonzero(np.repeat(~fixed, 3))
    faces = np.zeros((0, 3), int) if faces is None else faces

    def state(at):
        contacts = Contacts.of(at, faces, centres, radii) if len(centres) else None
        return (
            elements.energy(at)
            - np.sum(load * at)
            + (contacts.energy + friction.energy(at) if contacts else 0.0),
            contacts,
        )

    value, contacts = state(nodes)
    for _ in range(iterations):
        residual = (
            elements.forces(nodes)
            + load
            + (contacts.forces(nodes) + friction.forces(nodes) if contacts else 0.0)
        )
        pressed = PENALTY * contacts.depths.sum() if contacts else 0.0
        if np.abs(residual.ravel()[free]).max() < 1e-3 + 5e-3 * pressed:
            return nodes, contacts
        blocks = [(elements.tetrahedra, elements.stiffness(nodes))]
        if contacts:
            blocks += [(contacts.nodes, contacts.stiffness), (friction.nodes, friction.stiffness(nodes))]
        step = np.zeros(nodes.size)
        matrix = _matrix(blocks, nodes.size)[free][:, free].tocsc()
        step[free] = splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}).solve(
            residual.ravel()[free]
        )
        step = step.reshape(-1, 3) * min(1.0, 1e-3 / np.abs(step).max())
        length, trial = 1.0, state(nodes + step)
        while length > 1e-6 and (
            (half := state(nodes + length / 2 * step))[0] < trial[0] or trial[0] > value
        ):
            length, trial = length / 2, half
        nodes, (value, contacts) = nodes + length * step, trial
    raise RuntimeError(
        f"no equilibrium after {iterations} iterations: {np.abs(residual.ravel()[free]).max():.3g} N are left"
    )


def _matrix(blocks, size):
    rows, columns, values = [], [], []
    for nodes, block in blocks:
        dofs = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), nodes.shape[1] * 3)
        rows.append(np.repeat(dofs, dofs.shape[1], axis=1).ravel())
        columns.append(np.tile(dofs, (1, dofs.shape[1])).ravel())
        values.append(block.ravel())
    return coo_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (size, size)
    ).tocsr()
