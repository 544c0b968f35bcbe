"""Blood of an organ: out of its opened faces, over its surface, and off."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engines.fem.blood.clips import Clips
from engines.fem.blood.film import BILE, BLOOD, QUANTUM, Film
from engines.fem.blood.lumen import Lumen
from engines.fem.blood.tube_events import TubeEvents
from engines.fem.blood.tube_line import tube_line
from engines.fem.heat.tissue import tissue_of
from engines.fem.organ import Organ
from engines.tissue.organs.params import OrganParams
from schemas.ros import Header, Time
from schemas.soft_surface import FILM_STEP_M, FaceKind
from schemas.trocar_msgs import SurfaceFilm, TubeLine
from schemas.vectors import Vector

__all__ = ["Bleeding"]

_EMITTED, _DRIPPED, _SUCKED = range(3)
_ML = 1e6 * QUANTUM
_CLOSED = _UNKNOWN = -1


class Bleeding:
    """Faces that bleed, and the film on all faces.

    A face of the inside of a cut bleeds as long as its piece of the organ is tied to an anchor, and its
    tissue is not coagulated. An organ without anchors is supplied everywhere.
    """

    def __init__(self, organ: Organ, params: OrganParams, gravity: float, *, irrigated: bool = False) -> None:
        """Begin with an uncut, dry organ; `irrigated`: whether saline may come onto it."""
        self.organ = organ
        self._flows = _tissue_flows(params)
        """Flow out of an opened face of each layer, m/s."""
        self._clotting = None if params.bleeding is None else params.bleeding.clotting
        liquid = BILE if params.lumen is not None and params.lumen.liquid == "bile" else BLOOD
        self.film = Film(liquid, len(organ.nodes), gravity)
        if irrigated:
            self.film.may_be_irrigated()
        self._saline: NDArray[np.int64] = np.zeros(3 if irrigated else 0, np.int64)
        """Saline given, dripped off and sucked up, in parts of `QUANTUM`."""
        self.lumen: Lumen | None = None
        self.clips: Clips | None = None
        """Clips on a tube."""
        self.tube: TubeEvents | None = None
        """Events of a tube."""
        if params.lumen is not None and (wall := params.inner_wall) is not None:
            self.lumen = Lumen(params.lumen, liquid, organ, wall)
            self.clips = Clips(organ, self.lumen, wall.rings.size)
            self.tube = TubeEvents(organ, self.lumen, self.clips)
        self._opened: NDArray[np.int64] = np.full(len(organ.surface.faces), _CLOSED)
        """Time at which each face began to bleed, ns, or -1, shape (f,)."""
        self._book: NDArray[np.int64] = np.zeros(3, np.int64)
        """Blood emitted, dripped off and sucked up, in parts of `QUANTUM`."""
        self._rate: Vector = np.zeros(1)
        """Flow out of all faces, m^3/s."""
        self._source: Vector = np.zeros(3)
        """Mean place of the faces that bleed or bled last, m."""
        self._dry = self._picture(0, np.zeros(0, np.uint8))
        self._known = _UNKNOWN
        """Version of the mesh to which all this belongs."""
        self._velocity: Vector = np.zeros(len(self._opened))
        """Flow out of each face if it is open, m/s, shape (f,)."""

    @property
    def rate(self) -> float:
        """Flow out of the organ, ml/s."""
        return 1e6 * float(self._rate[0])

    @property
    def volumes(self) -> Vector:
        """Blood lost in all; of it on the surface, dripped off, sucked up; ml, (4,)."""
        emitted, dripped, sucked = self._book.tolist()
        return _ML * np.array([emitted, self.on_surface, dripped, sucked], np.float64)

    @property
    def on_surface(self) -> int:
        """Blood on the surface, in parts of `QUANTUM`."""
        return int(self.film.amounts.sum()) - self._saline_on_surface

    @property
    def _saline_on_surface(self) -> int:
        return 0 if self.film.saline is None else int(self.film.saline.sum())

    @property
    def saline(self) -> Vector:
        """Saline given in all; of it on the surface, dripped off, sucked up; ml, (4,)."""
        given, dripped, sucked = self._saline.tolist()
        return _ML * np.array([given, self._saline_on_surface, dripped, sucked], np.float64)

    @property
    def imbalance(self) -> int:
        """Blood emitted, less the blood that is somewhere, in parts of `QUANTUM`: always 0."""
        return int(self._book[_EMITTED] - self._book[_DRIPPED] - self._book[_SUCKED]) - self.on_surface

    @property
    def saline_imbalance(self) -> int:
        """Saline given, less the saline that is somewhere, in parts of `QUANTUM`: always 0."""
        given, *gone = self._saline.tolist() or [0]
        return given - sum(gone) - self._saline_on_surface

    def step(self, t: int, seconds: float) -> None:
        """Bleed and run for `seconds` until `t` ns."""
        self._follow()
        if self.clips is not None and self.tube is not None:
            self.tube.watch()
            for lost in self.clips.watch():
                self.organ.events.say("clip pulled off", "", lost.place, lost.force, "N")
                self.tube.say_lost(lost)
        faces, nodes = self.organ.surface.faces, self.organ.nodes
        bleeds = self.organ.surface.kinds == FaceKind.CUT
        if not bleeds.any() and not self._is_wet:
            return
        self._opened[bleeds & (self._opened == _CLOSED)] = t
        velocity = np.where(bleeds, self._velocity, 0.0)
        if self._clotting is not None:
            velocity *= np.maximum(0.0, 1.0 - (t - self._opened) / self._clotting)
        if self.lumen is not None:
            velocity += self.lumen.velocity(nodes, seconds)
        rates, emitted = self.film.emit(faces, nodes, velocity, seconds)
        self._book[_EMITTED] += emitted
        self._note(rates)
        before = self._saline_on_surface
        self._enter(_DRIPPED, self.film.run(faces, nodes, seconds), before)

    @property
    def _is_wet(self) -> bool:
        """Whether there has been liquid on the organ."""
        return bool(self._book[_EMITTED]) or bool(self._saline.any())

    def _enter(self, entry: int, gone: int, before: int) -> int:
        """Enter liquid that has left the surface into the books.

        `before`: saline on the surface before. Return the liquid.
        """
        saline = before - self._saline_on_surface
        self._book[entry] += gone - saline
        if saline:
            self._saline[entry] += saline
        return gone

    def _note(self, rates: Vector) -> None:
        """Take the flow out of each face (m^3/s, shape (f,)); say whether it begins or stops."""
        before, self._rate[0] = float(self._rate[0]), rates.sum()
        rate, say = float(self._rate[0]), self.organ.events.say
        flowing = "bleeding" if self.film.liquid is BLOOD else "leaking"
        if rate > 0.0:
            slots = np.flatnonzero(rates)
            places = self.organ.nodes[self.organ.surface.faces[slots]].mean(axis=1)
            self._source[:] = (rates[slots, None] * places).sum(axis=0) / rate
        if rate > 0.0 and before == 0.0:
            say(flowing, "", self._source.copy(), self.rate, "ml/s")
        elif rate == 0.0 and before > 0.0:
            say(f"{flowing} stopped", "", self._source.copy(), float(self.volumes[0]), "ml")

    def suck(self, centres: Vector, reach: Vector, most: int) -> int:
        """Take up to `most` within `reach` (m, (n,)) of `centres` (m, shape (n, 3)); return how much."""
        wet = np.flatnonzero(self.film.amounts)
        apart = self.organ.nodes[wet, None] - centres
        near = wet[(np.linalg.norm(apart, axis=2) < reach).any(axis=1)]
        before = self._saline_on_surface
        return self._enter(_SUCKED, self.film.take(near, most), before)

    def irrigate(self, centre: Vector, reach: float, amount: int) -> int:
        """Let saline fall within `reach` (m) of `centre` (m, shape (3,)); return how much stays here."""
        self._follow()
        present = np.flatnonzero(self._present)
        apart = self.organ.nodes[present] - centre
        near = present[(apart * apart).sum(axis=1) < reach * reach]
        if not near.size:
            return 0
        self.film.irrigate(near, amount)
        self._saline[_EMITTED] += amount
        return amount

    @property
    def _present(self) -> NDArray[np.bool_]:
        """Whether each node is on the surface, shape (n,)."""
        found = np.zeros(len(self.film.amounts), np.bool_)
        found[self.organ.surface.present] = True
        return found

    def picture(self, t: int) -> SurfaceFilm:
        """Return the message of the film at `t` ns; the same object as long as nothing has bled."""
        if not self._is_wet:
            return self._dry
        self._follow()
        return self._picture(t, self.film.thickness(self.organ.surface.faces, self.organ.nodes, FILM_STEP_M))

    def line(self, t: int) -> TubeLine | None:
        """Return the middle line of a tube at `t` ns; None: the organ has no lumen."""
        if self.lumen is None:
            return None
        self._follow()
        return tube_line(self.organ.name, self.lumen, t)

    def _picture(self, t: int, wet: NDArray[np.uint8]) -> SurfaceFilm:
        nodes = np.flatnonzero(wet)
        return SurfaceFilm(
            header=Header(stamp=Time.from_ns(t), frame_id="world"),
            body=self.organ.name,
            liquid=self.film.liquid.name,
            nodes=nodes.astype(np.uint32),
            thickness=wet[nodes],
        )

    @property
    def amounts(self) -> tuple[NDArray[np.int64], ...]:
        """Liquid at every node, and the book, in parts of `QUANTUM`; of saline too, if there may be any."""
        return self.film.amounts, self._book, *self._saline_amounts

    @property
    def _saline_amounts(self) -> tuple[NDArray[np.int64], ...]:
        return () if self.film.saline is None else (self.film.saline, self._saline)

    @property
    def state(self) -> tuple[NDArray[Any], ...]:
        """Arrays that the next step depends on."""
        tube = () if self.clips is None or self.tube is None else (*self.clips.state, *self.tube.state)
        more = (*self._saline_amounts, *tube)
        return self.film.amounts, self._opened, self._book, self._rate, self._source, *more

    def restore(self, parts: Iterator[bytes]) -> None:
        """Go back to a saved `state`; the organ has gone back already."""
        amounts, opened, book, rate, source, *more = (
            np.frombuffer(next(parts), array.dtype) for array in self.state
        )
        if self.film.saline is not None:
            saline, self._saline[:], *more = more
            self.film.saline = saline.copy()
        if self.clips is not None and self.tube is not None:
            self.clips.restore(*more[:2])
            self.tube.restore(*more[2:])
        self.film.amounts, self._opened = amounts.copy(), opened.copy()
        self._book[:], self._rate[:], self._source[:] = book, rate, source
        self._known = _UNKNOWN

    def _follow(self) -> None:
        """Take over nodes and faces of an organ that has been cut; liquid without a face drips off."""
        if self.organ.mesh_version == self._known:
            return
        added = len(self.organ.surface.faces) - len(self._opened)
        self._opened = np.concatenate([self._opened, np.full(added, _CLOSED)])
        self.film.append(len(self.organ.nodes))
        self._take_mesh()
        before = self._saline_on_surface
        everything = int(self.film.amounts.sum())
        self._enter(_DRIPPED, self.film.take(np.flatnonzero(~self._present), everything), before)

    def _take_mesh(self) -> None:
        """Find the flow out of each face, and the openings of a lumen."""
        self._known = self.organ.mesh_version
        solid, anchored = self.organ.solid, self.organ.anchored
        self._velocity = self._flows[self.organ.layers[solid.owners]]
        if anchored.any():
            pieces = solid.pieces
            tied = np.unique(pieces[anchored[solid.tetrahedra].any(axis=1)])
            self._velocity[~np.isin(pieces[solid.owners], tied[tied >= 0])] = 0.0
        if self.lumen is not None:
            self.lumen.find_openings()


def _tissue_flows(params: OrganParams) -> Vector:
    """Return the flow out of an opened face of each layer, m/s, shape (layers + 1,)."""
    names = (*(layer.material for layer in params.layers), params.material_name)
    given = params.bleeding
    if given is None:
        return np.zeros(len(names))
    perfusions = [
        tissue_of(name).blood_flow if given.perfusion is None else given.perfusion for name in names
    ]
    densities = [material.density for material in params.materials]
    return given.depth * np.array(perfusions) * np.array(densities)
