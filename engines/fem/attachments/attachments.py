"""All attachments of an engine: organs that hang together until they are pulled, cut or burnt apart."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from engines.fem.attachments.carried import carried_pieces
from engines.fem.attachments.conduction import conduct
from engines.fem.attachments.params import AttachmentParams
from engines.fem.attachments.ties import find_ties
from engines.fem.edges import Edges, Scissors
from engines.fem.heat.heat import Heat
from engines.fem.heat.tissue import BODY
from engines.fem.organ import Organ
from engines.fem.spheres import Spheres
from engines.tissue.meshing.tet_mesh import Indices
from engines.tissue.organs.anchors import AnchorParams
from engines.tissue.organs.params import OrganParams
from hub.participant import Value, signal_out
from schemas.errors import ScenarioError
from schemas.ports import Port
from schemas.ros import Header, Time
from schemas.soft_surface import FaceKind
from schemas.trocar_msgs import TiedPlaces
from schemas.vectors import Vector

__all__ = ["Attachments", "attachment_ports"]

_PARTING_RISE = 90.0 - BODY
"""Rise at which a tie is burnt, K: thin tissue dries at 90 to 100 degrees C (FUSE manual)."""


def attachment_ports(attachments: Mapping[str, AttachmentParams], period_ns: int) -> tuple[Port, ...]:
    """Return the ports of all attachments."""
    thirds = tuple(
        signal_out(
            f"{name}/lower_third",
            description="share that has parted of the third of the area nearest to the lower end",
            period_ns=period_ns,
        )
        for name, params in attachments.items()
        if params.lower_end is not None
    )
    return thirds + tuple(
        port
        for name, params in attachments.items()
        for port in (
            signal_out(f"{name}/freed", description="area that has parted", unit="m^2", period_ns=period_ns),
            signal_out(f"{name}/tied", description="area that is tied", unit="m^2", period_ns=period_ns),
            signal_out(
                f"{name}/force",
                description=f"force on '{params.organs[0]}', mean of a step",
                size=3,
                unit="N",
                frame="world",
                period_ns=period_ns,
            ),
            signal_out(
                f"{name}/ties",
                TiedPlaces,
                "where the organs still hang together",
                frame="world",
                period_ns=period_ns,
            ),
        )
    )


class Attachments:
    """Ties between organs, in one set of arrays; `_attach.c` holds them."""

    def __init__(
        self,
        attachments: Mapping[str, AttachmentParams],
        organs: Sequence[Organ],
        params: Mapping[str, OrganParams],
    ) -> None:
        """Tie organs at rest. Raises ScenarioError where nothing is near enough."""
        self._organs, self._names = organs, list(attachments)
        numbers = {organ.name: i for i, organ in enumerate(organs)}
        rows: list[Vector] = []
        self._lower: dict[str, NDArray[np.intp]] = {}
        """Ties of the lower third of each attachment with a lower end."""
        opened: list[NDArray[np.intp]] = []
        for k, (name, given) in enumerate(attachments.items()):
            one, other = (numbers[organ] for organ in given.organs)
            chosen = np.ones(len(organs[one].mesh.nodes), np.bool_)
            try:
                if given.surface is not None:
                    chosen = params[given.organs[0]].surface(AnchorParams(surface=given.surface))
                ties = find_ties(organs[one], organs[other], chosen, given.within)
            except ValueError as error:
                raise ScenarioError(f"attachment '{name}': {error}") from error
            count = len(ties.areas)
            if given.lower_end is not None:
                begun = sum(map(len, rows))
                nodes = organs[one].mesh.nodes[organs[one].solid.tetrahedra[ties.elements, ties.corners]]
                order, shares = _from_end(nodes, ties.areas, np.array(given.lower_end))
                self._lower[name] = begun + order[shares < 1.0 / 3.0]
                opened.append(begun + order[shares < given.opened])
            common = [np.full(count, number) for number in (k, one, other)]
            law = given.strength * ties.areas, np.full(count, 2.0 * given.toughness / given.strength)
            columns = (*common, ties.elements, ties.corners, ties.own_slots, ties.slots, ties.areas, *law)
            rows.append(np.column_stack([*columns, ties.shares, ties.gaps]))
        table = np.concatenate(rows)
        whole = table[:, :7].astype(np.int32)
        self._number, self._one, self._other, self._element, corner, self._own_slot, self._slot = whole.T
        self._corner = corner
        self._area: Vector = table[:, 7].copy()
        self.place: NDArray[np.int32] = np.ascontiguousarray(
            np.stack([self._one, 4 * self._element + corner, self._other, self._slot], axis=1)
        )
        """First organ, corner of an element, second organ, slot of a face, shape (t, 4)."""
        self.law, self.rest = (np.ascontiguousarray(part) for part in (table[:, 8:10], table[:, 10:]))
        """Strength (N) and last opening (m), shape (t, 2); place at rest: shares of the face's nodes and
        distance along its normal (m), shape (t, 4)."""
        self.widest: Vector = np.zeros(len(table))
        """Widest opening, m; infinite of a tie that has parted, shape (t,)."""
        for ties in opened:
            self.widest[ties] = np.inf
        self.force: Vector = np.zeros((len(table), 3))
        """Mean force on the first organ in the last step, N, shape (t, 3)."""
        self._known: NDArray[np.bool_] = np.isinf(self.widest)
        """Ties whose parting has been noted, shape (t,)."""
        tied = [i for i in range(len(organs)) if ((self._one == i) | (self._other == i)).any()]
        for i in tied:
            organs[i].hang(partial(self._carried, i), max(organs[k].reach for k in tied))
        self._edges: Edges | None = None
        self._before: Vector = np.zeros((0, 2, 3))

    def meet(self, spheres: Spheres, blades: Sequence[tuple[int, int]], scissors: Sequence[Scissors]) -> None:
        """Let blades between these spheres cut ties. `scissors`: pairs of the blades."""
        self._spheres = spheres
        self._edges = Edges(blades, 0, 1.0, scissors) if blades else None

    def begin(self, closing: Sequence[float]) -> None:
        """Note where the ties are before a step, if blades cut in it. `closing`: as for `Edges.sharpen`."""
        if self._edges is not None:
            self._edges.sharpen(closing)
            if self._edges.sharp.any():
                self._before = self._middles()

    def follow(self, heats: Sequence[Heat]) -> None:
        """Part what was cut or burnt in a step, and note what has parted. `heats`: of all organs, or none."""
        whole = ~np.isinf(self.widest)
        self._note(~whole & ~self._known, "pulled", self._holders)
        edges = self._edges
        if edges is not None and edges.sharp.any():
            self._note(whole & self._crossed(edges), "cut", lambda: edges.ends)
        if any(not heat.is_cold for heat in heats):
            self._note(whole & self._is_burnt(heats), "burnt", lambda: np.arange(len(self._spheres.radii)))

    def conduct(self, heats: Sequence[Heat], seconds: float) -> None:
        """Let heat go through whole ties for `seconds`. `heats`: of all organs."""
        for number in range(len(self._names)):
            ties = np.flatnonzero((self._number == number) & ~np.isinf(self.widest))
            if not ties.size:
                continue
            i, j = int(self._one[ties[0]]), int(self._other[ties[0]])
            faces = self._organs[j].solid.faces[self._slot[ties]]
            ties, faces = ties[faces[:, 0] >= 0], faces[faces[:, 0] >= 0]
            if not ties.size or (heats[i].is_cold and heats[j].is_cold):
                continue
            nodes = self._organs[i].solid.tetrahedra[self._element[ties], self._corner[ties]]
            shares, gaps = self.rest[ties, :3], self.rest[ties, 3]
            conduct(heats[i], heats[j], nodes, faces, shares, self._area[ties], gaps, seconds)

    def outputs(self, t: int) -> dict[str, Value]:
        """Return freed and tied areas, forces, and the places that are tied, at `t` ns."""
        count, parted = len(self._names), np.isinf(self.widest)
        lost: Vector = np.where(parted, self._area, 0.0)
        freed = np.bincount(self._number, lost, count).astype(np.float64)
        tied = np.bincount(self._number, self._area - lost, count).astype(np.float64)
        forces = [np.bincount(self._number, self.force[:, i], count) for i in range(3)]
        found: dict[str, Value] = {}
        places = self._places()
        for k, name in enumerate(self._names):
            found[f"{name}/freed"], found[f"{name}/tied"] = freed[k : k + 1], tied[k : k + 1]
            found[f"{name}/force"] = np.array([one[k] for one in forces])
            whole = ~parted & (self._number == k)
            found[f"{name}/ties"] = TiedPlaces(
                header=Header(stamp=Time.from_ns(t), frame_id="world"),
                attachment=name,
                points_m=places[whole].ravel(),
                areas_m2=self._area[whole],
            )
        for name, ties in self._lower.items():
            found[f"{name}/lower_third"] = lost[ties].sum(keepdims=True) / self._area[ties].sum()
        return found

    def restore(self, widest: Vector) -> None:
        """Go back to saved openings."""
        self.widest[:] = widest
        self._known[:] = np.isinf(widest)

    def _carried(self, number: int) -> Indices:
        """Return the pieces of an organ that something carries."""
        ends = np.stack([self._one, self._element, self._other, self._owners()], axis=1)
        return carried_pieces(self._organs, ends[~np.isinf(self.widest)])[number]

    def _owners(self) -> NDArray[np.int32]:
        """Return the element of the second organ at each tie, shape (t,)."""
        found = np.zeros(len(self.widest), np.int32)
        for i, organ in enumerate(self._organs):
            its = self._other == i
            found[its] = organ.solid.owners[self._slot[its]]
        return found

    def _note(self, parted: NDArray[np.bool_], why: str, spheres: Callable[[], NDArray[np.integer]]) -> None:
        """Part these ties, if they are whole; say so for each pair of organs, by the nearest of the spheres.

        Torn and cut surfaces are raw, and bleed.
        """
        if not parted.any():
            return
        causes = np.unique(spheres())
        self.widest[parted], self._known[parted] = np.inf, True
        kind = FaceKind.COAGULATED if why == "burnt" else FaceKind.CUT
        for i, organ in enumerate(self._organs):
            own = parted & (self._one == i)
            if own.any():
                places = organ.solid.nodes[organ.solid.tetrahedra[self._element[own], self._corner[own]]]
                instruments = self._spheres.nearest(places, causes)
                organ.events.add("detached", self._area[own], places, instruments)
            organ.expose(np.union1d(self._own_slot[own], self._slot[parted & (self._other == i)]), kind)

    def _places(self) -> Vector:
        """Return the middle between the two organs at each tie, m, shape (t, 3)."""
        found = np.zeros((len(self.widest), 3))
        for i, organ in enumerate(self._organs):
            nodes = organ.solid.nodes
            own, its = self._one == i, self._other == i
            found[own] += 0.5 * nodes[organ.solid.tetrahedra[self._element[own], self._corner[own]]]
            faces = organ.solid.faces[self._slot[its]]  # -1 of a face that has gone: its tie has parted
            found[its] += 0.5 * (self.rest[its, :3, None] * nodes[faces]).sum(axis=1)
        return found

    def _holders(self) -> NDArray[np.int32]:
        """Return the spheres that hold tissue."""
        return np.concatenate([organ.solid.holder[organ.held] for organ in self._organs])

    def _middles(self) -> Vector:
        """Return the middles of the elements on both sides of each tie, m, shape (t, 2, 3)."""
        found = np.zeros((len(self.widest), 2, 3))
        for i, organ in enumerate(self._organs):
            nodes = organ.solid.nodes
            own, its = self._one == i, self._other == i
            found[own, 0] = nodes[organ.solid.tetrahedra[self._element[own]]].mean(axis=1)
            elements = organ.solid.owners[self._slot[its]]
            found[its, 1] = nodes[organ.solid.tetrahedra[elements]].mean(axis=1)
        return found

    def _crossed(self, edges: Edges) -> NDArray[np.bool_]:
        """Return which ties, between the middles of their elements, an edge has swept across, shape (t,)."""
        now = self._middles()
        moved = (now - self._before).mean(axis=1)
        found = np.zeros(len(now), np.bool_)
        for first, last in edges.ends[edges.sharp]:
            begun, ended = (self._spheres.path[k][[first, last]] for k in (0, -1))
            low, high = np.minimum(begun.min(axis=0), ended.min(axis=0)), np.maximum(begun, ended).max(axis=0)
            near = ((now.max(axis=1) >= low) & (now.min(axis=1) <= high)).all(axis=1)
            if near.any():
                a, b = begun[0] + moved, begun[1] + moved
                c, d = np.broadcast_to(ended[0], a.shape), np.broadcast_to(ended[1], a.shape)
                found |= near & (_crosses(now, a, b, c) | _crosses(now, b, d, c))
        return found

    def _is_burnt(self, heats: Sequence[Heat]) -> NDArray[np.bool_]:
        """Return which ties are as hot as boiling water on one side, shape (t,)."""
        found = np.zeros(len(self.widest), np.bool_)
        for i, (organ, heat) in enumerate(zip(self._organs, heats, strict=True)):
            if heat.is_cold:
                continue
            own, its = self._one == i, self._other == i
            nodes = organ.solid.tetrahedra[self._element[own], self._corner[own]]
            found[own] |= heat.rise[nodes] >= _PARTING_RISE
            faces = organ.solid.faces[self._slot[its]]
            rises = np.where(faces < 0, 0.0, heat.rise[faces])  # of a face that has gone: none
            found[its] |= (rises * self.rest[its, :3]).sum(axis=1) >= _PARTING_RISE
        return found


def _from_end(points: Vector, areas: Vector, end: Vector) -> tuple[NDArray[np.intp], Vector]:
    """Return ties in the order of their distance from a point, and the share of the area before each.

    points: places of the ties, m, shape (t, 3). areas: m^2, shape (t,).
    """
    order = np.argsort(np.linalg.norm(points - end, axis=1), kind="stable")
    before: Vector = np.cumsum(areas[order]) - areas[order]
    return order, before / areas.sum()


def _crosses(ways: Vector, a: Vector, b: Vector, c: Vector) -> NDArray[np.bool_]:
    """Return whether ways (from, to; shape (t, 2, 3)) cross triangles with corners a, b, c, shapes (t, 3)."""
    start, way = ways[:, 0], ways[:, 1] - ways[:, 0]
    u, v, off = b - a, c - a, start - a
    normal = np.cross(u, v)
    whole = -(way * normal).sum(axis=1)
    whole = np.where(whole == 0.0, np.nan, whole)  # parallel: no comparison holds
    along = (off * normal).sum(axis=1) / whole
    turn = np.cross(off, way)
    s, t = (v * turn).sum(axis=1) / whole, -(u * turn).sum(axis=1) / whole
    return (along >= 0.0) & (along <= 1.0) & (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)
