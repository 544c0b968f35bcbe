"""An organ: an anchored body of soft tissue, and the spheres that hold its nodes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray
from xxhash import xxh3_128_digest

from engines.fem.boxes import NO_BOXES
from engines.fem.edges import NO_EDGES, Edges, Scissors
from engines.fem.solid import Branch, Layering, Solid, SphereWay
from engines.fem.spheres import Spheres
from engines.fem.tissue_events import TissueEvents
from engines.tissue.material import Material
from engines.tissue.meshing.tet_mesh import Indices
from engines.tissue.organs.params import OrganParams
from engines.tissue.tissue_surface import SurfaceState, TissueSurface
from engines.tissue.warn_once import warn_once
from schemas.errors import SessionError
from schemas.plain_sum import plain_sum
from schemas.soft_surface import FaceKind
from schemas.vectors import Vector

__all__ = ["Organ", "relaxation", "still_way"]

_VISCOUS_SHARE = 1.0
"""Shear modulus of the branch for `damping`, over that of the material. The damping of a branch is modulus
times relaxation time: up to the frequency 1 / damping that of stiffness-proportional damping.
"""
_SETTLED_PERIODS = 3.0
"""Time of settling under weight, in periods of the slowest swing, which drag damps critically."""
_LEAST_SETTLING_S = 0.1
_FOLDED = 3.0
"""Way that a node of a divided organ may go, over the extent of the organ: a freed flap is folded back."""
_NO_SPHERES = np.zeros(0), np.zeros(0, np.uint8)
_SAMPLES = 40
"""Points along a blade: the width of a cut is known to a fortieth of the blade's length."""


def relaxation(params: OrganParams) -> list[Branch]:
    """Return the branches of the organ's Prony series."""
    remaining = 1.0 - plain_sum(term.share for term in params.series)
    return [Branch(term.share / remaining, term.seconds) for term in params.series]


def _slowest_on_a_bed(material: Material, extent: float) -> float:
    """Return the lowest natural frequency (rad/s) of a column as long as the organ, on its end."""
    return 0.5 * np.pi * sqrt(material.young_modulus / material.density) / extent


def still_way(sub_steps: int) -> SphereWay:
    """Return the way of no spheres."""
    return SphereWay(np.zeros((sub_steps + 1, 0, 3)), *_NO_SPHERES)


class Organ:
    """Tissue of one name."""

    def __init__(
        self, name: str, params: OrganParams, boxes: Vector = NO_BOXES, *, is_carried: bool = False
    ) -> None:
        """`boxes`: fixed rigid parts, rows of `box_rows`; `is_carried`: whether they or organs carry it."""
        self.name, self.mesh = name, params.rest
        self._anchored: NDArray[np.bool_] = np.zeros(len(self.mesh.nodes), dtype=np.bool_)
        for tied in params.anchored_nodes.values():
            self._anchored |= tied
        edges = (
            self.mesh.nodes[self.mesh.triangles] - self.mesh.nodes[np.roll(self.mesh.triangles, 1, axis=1)]
        )
        self.mean_edge = float(np.linalg.norm(edges, axis=2).mean())
        self.friction = params.contact_friction
        heavy = tuple(replace(one, density=params.inertia * one.density) for one in params.materials)
        material = heavy[-1]
        branches = [Branch(_VISCOUS_SHARE, material.damping)] if material.damping else []
        branches += relaxation(params)
        self.every = 1
        """Sub-steps between the forces of the elements."""
        self._cutting = params.cutting
        divisible = params.cutting is not None
        layering = Layering(heavy, params.layer_numbers(self.mesh.tetrahedra))
        self.solid = Solid(
            self.mesh,
            self._anchored,
            material,
            branches,
            divisible=divisible,
            layering=layering,
            boxes=boxes,
            most_ties=0 if params.inner_wall is None else params.inner_wall.rings.size,
            weight_share=1.0 / params.inertia,
        )
        self.layers = params.layer_numbers(self.solid.tetrahedra)
        """Number of the layer of every element, shape (m,)."""
        self.surface = TissueSurface(self.mesh.triangles, len(self.mesh.nodes))
        """Faces as seen, with the kind of tissue of each."""
        self.touchable = self._touchable_faces()
        """Faces with a free node, shape (f, 3)."""
        self.events = TissueEvents()
        self._edges = NO_EDGES
        self.reach = float(np.linalg.norm(np.ptp(self.mesh.nodes, axis=0)))
        """Diagonal of the organ, m."""
        self._farthest = (_FOLDED if divisible else 1.0) * self.reach
        """Displacement of an unstable organ, m."""
        self._slowest = params.frequencies[1]
        if self._slowest is not None:
            self._slowest /= sqrt(params.inertia)
        if self._slowest is None and is_carried:
            self._slowest = _slowest_on_a_bed(material, self.reach)
        self._presses = self._free = np.ones(0, np.uint8)
        self.mesh_version = 0
        """Count of the changes of the mesh."""
        self._loose = np.array([self._loose_share()])
        self.nodes: Vector = self.mesh.nodes
        self._carried: Callable[[], NDArray[np.integer]] = self._held_now

    @property
    def anchored(self) -> NDArray[np.bool_]:
        """Anchored nodes, shape (n,)."""
        return self._anchored[self.solid.origin]

    @property
    def origins(self) -> NDArray[np.int32]:
        """Node of the mesh at the resting place of each node, shape (n,)."""
        return self.solid.origin

    @property
    def probes(self) -> list[str]:
        """Names of the probes that may touch the organ."""
        return list(dict.fromkeys(self._spheres.probes))

    def probe_of(self, sphere: int) -> str:
        """Return the name of the probe of a sphere."""
        return self._spheres.probes[sphere]

    @property
    def held(self) -> NDArray[np.bool_]:
        """Nodes held by a grasp, shape (n,)."""
        return self.solid.holder >= 0

    @property
    def sums(self) -> dict[str, Vector]:
        """Area and work of cuts, and the share of loose tissue, by port; nothing for an undivided organ."""
        if self._cutting is None:
            return {}
        area = self._edges.swept
        return {
            f"{self.name}/cut_area": area.copy(),
            f"{self.name}/cut_work": self._cutting.toughness * area,
            f"{self.name}/loose": self._loose,
        }

    @property
    def settling_s(self) -> float:
        """Time in which the organ comes to rest, s; 0 for one that nothing carries."""
        if self._slowest is None:
            return 0.0
        return max(_LEAST_SETTLING_S, _SETTLED_PERIODS * 2.0 * np.pi / self._slowest)

    @property
    def settling_drag(self) -> float:
        """Damping over mass meanwhile, 1/s."""
        return 2.0 * (self._slowest or 0.0)

    def settle(self, gravity: float) -> None:
        """Let the organ come to rest under its weight (m/s^2, along -z)."""
        if not self.settling_s:
            return
        way = still_way(self.solid.sub_steps(self.settling_s))
        self.solid.advance(self.settling_s, way, 0.0, gravity, drag=self.settling_drag)
        self.stand()

    def stand(self) -> None:
        """Stop all nodes."""
        self.solid.stand()
        self.sample(0)

    def advance(self, seconds: float, gravity: float) -> None:
        """Advance on its own."""
        if self.solid.compiled.advance(*self.arguments(seconds, gravity)):
            self.follow_surface()

    def arguments(self, seconds: float, gravity: float) -> tuple[Any, ...]:
        """Return the arguments of `_solid.c` for a step of `seconds`, the same objects for every step."""
        return self.solid.arguments(seconds, self.way, self.forces, self.friction, gravity, 0.0, self.every)

    def sharpen(self, closing: Sequence[float]) -> None:
        """Let scissors cut that close. `closing`: rates as for `Edges.sharpen`."""
        self._edges.sharpen(closing)

    def follow_surface(self) -> None:
        """Note faces that have been cut open."""
        if self.solid.counts[1] != len(self.surface.faces):
            self._note_opened("cut", np.unique(self._edges.ends))
            self._note_change()

    def tear(self) -> None:
        """Open faces that are stretched beyond the limit of the tissue, if there is one."""
        cutting = self._cutting
        if cutting is None or cutting.tear_stretch is None:
            return
        if self.solid.tear(cutting.tear_stretch, cutting.tear_toughness):
            self._note_opened("torn", np.unique(self.solid.holder[self.held]))
            self._note_change()

    def remove(self, elements: Indices) -> None:
        """Let elements go."""
        if self.solid.remove(elements):
            self._note_change()

    def sample(self, time_ns: int) -> None:
        """Read the nodes. Raises SessionError if the tissue has become unstable by `time_ns`."""
        self.nodes = self.solid.nodes
        moved = self._largest_move()
        if self.solid.divisible and moved >= self.reach:
            self._drop_loose_pieces()
            moved = self._largest_move()
        if not moved < self._farthest:
            raise SessionError(
                f"organ '{self.name}' became unstable by {time_ns * 1e-9:.6g} s: a node is {moved:.3g} m from"
                f" its place. {self._likely_cause(moved)}"
            )

    def _likely_cause(self, moved: float) -> str:
        if np.isfinite(moved) and not self._anchored.any():
            return "The likeliest cause is that it fell: nothing anchors it, and no rigid part lies under it"
        return "The likeliest cause is an instrument that went through it; else shorten the tissue's timestep"

    def colour(self, kinds: NDArray[np.uint8]) -> None:
        """Show the kind of tissue of burnt elements, shape (m,), on their faces; 0: not burnt."""
        found = kinds[self.solid.owners]
        burnt = np.flatnonzero((found > 0) & (found != self.surface.kinds))
        if burnt.size:
            self.surface.replace(burnt, self.surface.faces[burnt], found[burnt])

    def expose(self, slots: NDArray[np.integer], kind: FaceKind) -> None:
        """Show faces of the outside, by slot, as this kind: something has come off them."""
        is_outside = (self.surface.kinds[slots] == FaceKind.OUTSIDE) & (self.surface.faces[slots, 0] >= 0)
        found = slots[is_outside]
        if found.size:
            self.surface.replace(found, self.surface.faces[found], np.full(len(found), kind, np.uint8))

    def _largest_move(self) -> float:
        """Return the largest displacement of a node with mass, m."""
        moves = np.abs(self.solid.displacement[self.solid.mass > 0.0, :3])
        return float(moves.max()) if moves.size else 0.0

    def _drop_loose_pieces(self) -> None:
        """Take away pieces that nothing carries and that have fallen farther than the organ is large."""
        far = np.abs(self.solid.displacement[:, :3]).max(axis=1) >= self.reach
        pieces = self.solid.pieces
        fallen = np.setdiff1d(self._pieces_with(far, pieces), [-1, *self._carried()])
        elements = np.flatnonzero(np.isin(pieces, fallen))
        if elements.size:
            warn_once(
                f"organ '{self.name}': a loose piece has fallen out of sight and is taken away, and so are"
                " those that follow"
            )
            self.remove(elements)

    def hang(self, carried: Callable[[], NDArray[np.integer]], reach: float) -> None:
        """Be tied to other organs.

        Args:
            carried: returns the pieces of this organ that something carries, through whole ties too.
            reach: size of the largest organ that this one may be carried along by, m.
        """
        self._carried = carried
        self._farthest = max(self._farthest, _FOLDED * reach)

    def held_pieces(self, pieces: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return which of the pieces, by element, are anchored or grasped, shape (n,)."""
        found = self._pieces_with(self.anchored | self.held, pieces)
        return found[found >= 0]

    def _held_now(self) -> NDArray[np.int32]:
        return self.held_pieces(self.solid.pieces)

    def _pieces_with(self, nodes: NDArray[np.bool_], pieces: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the pieces with any of these nodes, shape (n,)."""
        return np.unique(pieces[nodes[self.solid.tetrahedra].any(axis=1)])

    def _loose_share(self) -> float:
        """Return the share of the mass in pieces without an anchor."""
        pieces, masses = self.solid.pieces, self.solid.element_masses
        is_tied = np.isin(pieces, self._pieces_with(self.anchored, pieces))
        return float(masses[~is_tied].sum() / max(masses.sum(), 1e-30))

    def _note_opened(self, kind: str, spheres: NDArray[np.int32]) -> None:
        """Note the newly opened faces as an event of the nearest of these spheres."""
        opened = self.solid.faces[len(self.surface.faces) :]
        areas, places = self.solid.areas(opened), self.solid.nodes[opened].mean(axis=1)
        self.events.add(kind, 0.5 * areas, places, self._spheres.nearest(places, spheres))  # two sides each

    def note_burnt(self, elements: Indices, volumes: Vector, spheres: NDArray[np.int64]) -> None:
        """Note elements with volumes (m^3, shape (n,)) as burnt by the nearest of these spheres."""
        places = self.solid.nodes[self.solid.tetrahedra[elements]].mean(axis=1)
        self.events.add("burnt", volumes, places, self._spheres.nearest(places, spheres))

    def _note_change(self) -> None:
        """Bring surface, nodes and touchable faces up to date."""
        self.surface.follow(self.solid.faces, self.solid.origin)
        self.nodes = self.solid.nodes
        self.touchable = self._touchable_faces()
        self._loose = np.array([self._loose_share()])
        self.mesh_version += 1

    def _touchable_faces(self) -> Indices:
        faces = self.surface.present.astype(np.int64)
        return faces[~self.anchored[faces].all(axis=1)]

    def anchor(self, node: int, body: int) -> int:
        """Tie a node to a sphere; return the node."""
        self.solid.hold(node, body)
        return node

    def release(self, node: int, anchor: int) -> None:  # noqa: ARG002  a tie is its node
        """Undo `anchor`."""
        self.solid.let_go(node)

    def let_touch(self, body: int, *, on: bool) -> None:
        """Let a sphere press the organ, or pass through."""
        self._free[body] = self._presses[body] if on else 0

    def meet(
        self,
        spheres: Spheres,
        blades: Sequence[tuple[int, int]] = (),
        scissors: Sequence[Scissors] = (),
    ) -> None:
        """Let these spheres press the organ, and blades between some of them cut it, if it may be cut.

        scissors: pairs of the blades.
        """
        self._spheres, self.events = spheres, TissueEvents(spheres.probes)
        self._presses = np.ones(len(spheres.radii), np.uint8)
        if self._cutting is not None and blades:
            self._presses[np.unique(blades)] = 0  # ends of blades pass through
            self._edges = Edges(blades, _SAMPLES, self._cutting.toughness, scissors)
        self._free = self._presses.copy()
        self.way = SphereWay(spheres.path, spheres.radii, self._free, self._edges)
        """Ways of the spheres in a step."""
        self.forces = self.way.no_forces()
        """Force on each sphere in each sub-step of the last step, N, shape (k, n, 3)."""

    def held_by(self, bodies: Collection[int]) -> list[int]:
        """Return the nodes that these spheres hold."""
        return np.flatnonzero(np.isin(self.solid.holder, list(bodies))).tolist()

    @property
    def digest(self) -> bytes:
        """16 bytes by the displacements."""
        return xxh3_128_digest(self.solid.displacement.tobytes())

    @property
    def parts(self) -> Iterator[NDArray[np.generic]]:
        """Arrays that the next step depends on, in the order of `restore`."""
        yield np.array(self.solid.counts)
        yield from self.solid.state
        yield self._free
        yield from self._edges.state
        yield from self.events.state
        yield from self.surface.state

    def restore(self, parts: Iterator[bytes]) -> None:
        """Go back to saved `parts`. Raises ValueError for those of another organ."""
        nodes, faces = np.frombuffer(next(parts), np.int64).tolist()
        self.solid.counts = nodes, faces
        for array in (*self.solid.state, self._free, *self._edges.state):
            array[...] = np.frombuffer(next(parts), array.dtype).reshape(array.shape)
        self.events.restore(parts)
        version, faces, kinds, origins = (
            np.frombuffer(next(parts), kept.dtype).reshape(-1, *kept.shape[1:]) for kept in self.surface.state
        )
        self.surface.restore(
            SurfaceState(
                version.astype(np.int64),
                faces.astype(np.int32),
                kinds.astype(np.uint8),
                origins.astype(np.int32),
            )
        )
        self.nodes = self.solid.nodes
        self.touchable = self._touchable_faces()
        self._loose = np.array([self._loose_share()])
