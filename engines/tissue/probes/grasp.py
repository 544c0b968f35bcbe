"""Grasp of tissue: fingers closed on an organ hold nodes; opening or too strong a pull frees the nodes.

Friction of spheres on Bullet's tissue creeps, so held nodes are anchored to the proxies, and an anchor passes
on the whole force. Rules and figures: docs/decisions/0016-tissue-grasp.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from engines.tissue.organs.body import Body
from engines.tissue.probes.held_patch import PatchCompliance, patch_at
from engines.tissue.probes.params import GraspParams
from engines.tissue.probes.place import Surface
from engines.tissue.warn_once import warn_once
from hub.participant import Value, event_out, signal_out
from schemas.ports import Port
from schemas.ros import Float64Message, Header, Time
from schemas.trocar_msgs import TissueGrasp
from schemas.vectors import Vector

__all__ = ["Grasp", "GraspedOrgan", "GraspingProbe", "grasp_ports", "nothing_held"]

_CLOSING_M = 0.5e-3
"""Closing of the fingers on tissue for a grasp, and opening from there for a release.

Half of the distance between two jaws.
"""

_SHUT_M = 0.5e-3
"""Gap between fully closed fingers."""

_SQUEEZE_N = 0.1
"""Least force of tissue against each closing finger for a grasp."""


def grasp_ports(probe: str) -> tuple[Port, ...]:
    """Return the ports of a grasping probe."""
    return (
        signal_out(f"{probe}/held", Float64Message, "1 while tissue is held, else 0"),
        signal_out(
            f"{probe}/pull", description="force on the tissue that is held", size=3, unit="N", frame="world"
        ),
        signal_out(f"{probe}/lift", Float64Message, "mean rise of the nodes held, since time 0", unit="m"),
        event_out(f"{probe}/events", TissueGrasp, "grasped, released, torn"),
    )


def nothing_held(probe: str) -> dict[str, Value]:
    """Return the outputs of a probe without contact."""
    return {
        f"{probe}/held": np.zeros(1),
        f"{probe}/pull": np.zeros(3),
        f"{probe}/lift": np.zeros(1),
        f"{probe}/events": (),
    }


class GraspedOrgan(Body, Protocol):
    """An organ whose nodes can be tied to spheres."""

    @property
    def held(self) -> NDArray[np.bool_]:
        """Nodes held by a grasp, shape (n,)."""
        ...

    @property
    def origins(self) -> NDArray[np.integer]:
        """Node of the mesh at the resting place of each node, shape (n,)."""
        ...

    @property
    def mean_edge(self) -> float:
        """Mean length of an edge of the surface, m."""
        ...

    def anchor(self, node: int, body: int) -> int:
        """Tie a node to a sphere by the engine's number, where both are now; return the number of the tie."""
        ...

    def release(self, node: int, anchor: int) -> None:
        """Undo `anchor`."""
        ...

    def let_touch(self, body: int, *, on: bool) -> None:
        """Let a sphere by the engine's number press the organ, or pass through."""
        ...


class GraspingProbe(Protocol):
    """The spheres of fingers in an engine."""

    name: str
    radii: Vector
    """m, shape (n,)."""
    targets: Vector
    """Centres of the spheres on the instrument, m, in `world`, shape (n, 3)."""
    positions: Vector
    """Centres of the spheres in the engine, m, in `world`, shape (n, 3)."""
    held: NDArray[np.bool_]
    """Spheres with tied tissue, shape (n,)."""
    touching: NDArray[np.bool_]
    """Spheres touching an organ at the last reading, shape (n,)."""
    bodies: list[int]
    """The engine's number of every sphere."""

    @property
    def forces(self) -> Vector:
        """Force of the instrument on every sphere, N, shape (n, 3)."""
        ...

    def hold(self, spheres: NDArray[np.int64], *, held: bool) -> None:
        """Mark spheres as holding tissue or not."""
        ...

    def soften(self, spheres: NDArray[np.int64], patch: PatchCompliance) -> None:
        """Let spheres with a common pull yield by `compliance`, m/N, shape (3, 3)."""
        ...


@dataclass(frozen=True)
class _Hold:
    """The held part of an organ."""

    organ: GraspedOrgan
    nodes: NDArray[np.int64]
    anchors: list[int]
    rest: Vector
    """Heights of the nodes at time 0, m."""


class Grasp:
    """Watches the fingers of a probe, and ties tissue to the fingers."""

    def __init__(
        self,
        params: GraspParams,
        probe: GraspingProbe,
        organs: Sequence[GraspedOrgan],
        surfaces: Sequence[Surface] = (),
    ) -> None:
        """`organs`: organs for the fingers of `probe`; `surfaces`: their surfaces, with a `width`."""
        self._params, self._probe, self._organs = params, probe, organs
        self._surfaces = {surface.organ.name: surface for surface in surfaces}
        self._spheres = np.arange(len(probe.radii)).reshape(params.fingers, -1)  # (fingers, spheres of each)
        self._rest = [organ.nodes[:, 2].copy() for organ in organs]
        self._holds: list[_Hold] = []
        self._widest = 0.0
        """Widest spread of the fingers since first contact; during a grasp the spread at its beginning, m."""
        self._held, self._pull, self._lift = np.zeros(1), np.zeros(3), np.zeros(1)
        self._lost: tuple[TissueGrasp, ...] = ()
        """Events of the present step so far."""
        self.outputs = nothing_held(probe.name)

    def take_away(self, t: int) -> None:
        """Let go of the tissue at the beginning `t` (ns) of a step: the instrument leaves the arm."""
        if self._holds:
            self._lost = self._let_go("exchanged while holding", t)

    def update(self, t: int, *, looked: bool) -> None:
        """Grasp or release at the end `t` (ns) of a step.

        `looked`: the organs' nodes, and the contacts with them, have been read at the end of this step.
        """
        events, self._lost = self._lost, ()
        if self._holds:
            self._pull[:] = self._probe.forces[self._probe.held].sum(axis=0)
            if float(self._pull @ self._pull) > self._params.hold**2:
                events = self._let_go("torn", t)
            elif looked:
                events = self._watch_hold(t)
        elif looked:
            events = self._watch(t)
        self._write_outputs(events)

    def untie(self) -> None:
        """Untie the held tissue, and let the holding spheres touch the tissue again."""
        for hold in self._holds:
            for node, anchor in zip(hold.nodes.tolist(), hold.anchors, strict=True):
                hold.organ.release(node, anchor)
        self._set_held(np.flatnonzero(self._probe.held), held=False)

    @property
    def state(self) -> tuple[Vector, ...]:
        """State between steps: the spread for comparison, outputs, and the nodes held."""
        return (
            np.array([self._widest]),
            self._pull,
            self._lift,
            *(hold.nodes.astype(np.float64) for hold in self._holds),
        )

    @property
    def numbers(self) -> Vector:
        """Spread, pull and lift, to be set by `resume`, shape (5,)."""
        return np.concatenate([[self._widest], self._pull, self._lift])

    def resume(self, numbers: Vector, ties: Sequence[tuple[GraspedOrgan, list[int], list[int]]]) -> None:
        """Go on as saved, with the tied nodes and the ties of organs, which exist already."""
        self._widest, self._pull[:], self._lift[:] = float(numbers[0]), numbers[1:4], numbers[4:]
        rest = {organ.name: heights for organ, heights in zip(self._organs, self._rest, strict=True)}
        self._holds = [
            _Hold(organ, np.array(nodes, np.int64), anchors, rest[organ.name][organ.origins[nodes]])
            for organ, nodes, anchors in ties
        ]
        self._write_outputs(())

    def _finger_spread(self) -> float:
        """Return the mean distance (m) of the middles of the instrument's fingers from the middle of all."""
        middles = self._probe.targets[self._spheres].mean(axis=1)  # (fingers, 3)
        return float(np.linalg.norm(middles - middles.mean(axis=0), axis=1).mean())

    def _watch_hold(self, t: int) -> tuple[TissueGrasp, ...]:
        """Release the tissue if the fingers have opened; else measure the lift."""
        if self._finger_spread() > self._widest + _CLOSING_M:
            return self._let_go("released", t)
        self._lift[0] = np.concatenate(
            [hold.organ.nodes[hold.nodes, 2] - hold.rest for hold in self._holds]
        ).mean()
        return ()

    def _watch(self, t: int) -> tuple[TissueGrasp, ...]:
        """Grasp if at least two fingers touch tissue, have closed since, and can close no further."""
        touching = self._probe.touching[self._spheres].max(axis=1)
        if touching.sum() < 2:
            self._widest = 0.0
            return ()
        spread = self._finger_spread()
        self._widest = max(self._widest, spread)
        if spread > self._widest - _CLOSING_M:
            return ()
        outward = self._outward_directions()
        squeezed = touching & (
            -(self._probe.forces[self._spheres].sum(axis=1) * outward).sum(axis=1) >= _SQUEEZE_N
        )
        if squeezed.sum() >= 2:
            return self._take(squeezed, outward, spread, t)
        if self._least_gap(touching) <= _SHUT_M:
            return self._take(touching, outward, spread, t)
        return ()

    def _outward_directions(self) -> Vector:
        """Return the direction from the middle of all fingers to each, shape (fingers, 3)."""
        middles = self._probe.positions[self._spheres].mean(axis=1)
        arms = middles - middles.mean(axis=0)
        return arms / np.maximum(np.linalg.norm(arms, axis=1, keepdims=True), 1e-12)

    def _least_gap(self, fingers: NDArray[np.bool_]) -> float:
        """Return the least gap (m) between spheres of different fingers."""
        spheres = self._spheres[fingers]
        of = np.repeat(np.arange(len(spheres)), spheres.shape[1])
        positions, radii = self._probe.positions[spheres.ravel()], self._probe.radii[spheres.ravel()]
        gaps = np.linalg.norm(positions[:, None] - positions, axis=2) - radii[:, None] - radii
        return float(gaps[of[:, None] != of].min())

    def _take(
        self, fingers: NDArray[np.bool_], outward: Vector, spread: float, t: int
    ) -> tuple[TissueGrasp, ...]:
        """Anchor the nodes within reach of these fingers' inner sides, each to the nearest sphere."""
        probe, spheres = self._probe, self._spheres[fingers].ravel()
        radii = probe.radii[spheres]
        # (k, 3): where the spheres face the other fingers
        pads = probe.positions[spheres] - radii[:, None] * np.repeat(
            outward[fingers], self._spheres.shape[1], axis=0
        )
        for organ, rest in zip(self._organs, self._rest, strict=True):
            distances = np.linalg.norm(organ.nodes[:, None] - pads, axis=2) - radii  # (n, k)
            nodes = np.flatnonzero(
                (distances.min(axis=1) <= self._reach(organ)) & ~organ.anchored & ~organ.held
            )
            if nodes.size:
                nearest: list[int] = spheres[distances[nodes].argmin(axis=1)].tolist()
                anchors = [
                    organ.anchor(node, probe.bodies[sphere])
                    for node, sphere in zip(nodes.tolist(), nearest, strict=True)
                ]
                self._holds.append(_Hold(organ, nodes, anchors, rest[organ.origins[nodes]]))
        if self._holds:
            self._widest = spread
            self._set_held(spheres, held=True)
            self._soften(spheres)
        return self._events("grasped", t)

    def _soften(self, spheres: NDArray[np.int64]) -> None:
        """Let these spheres yield as a patch of the pad's width does, given a `width` and a single organ."""
        width = self._params.width
        if width is None:
            return
        if len(self._holds) != 1:
            held = " and ".join(f"'{hold.organ.name}'" for hold in self._holds)
            warn_once(
                f"probe '{self._probe.name}' holds {held}: its grasp.width counts for one organ alone, so the"
                " pull is that of the nodes that the meshes hold"
            )
            return
        hold = self._holds[0]
        surface = self._surfaces[hold.organ.name]
        self._probe.soften(spheres, patch_at(surface.compliance, surface.material, hold.nodes, width))

    def _reach(self, organ: GraspedOrgan) -> float:
        return organ.mean_edge / sqrt(3.0) if self._params.reach is None else self._params.reach

    def _let_go(self, why: str, t: int) -> tuple[TissueGrasp, ...]:
        events = self._events(why, t)
        self.untie()
        self._holds.clear()
        self._widest = 0.0
        self._pull[:], self._lift[:] = 0.0, 0.0
        return events

    def _set_held(self, spheres: NDArray[np.int64], *, held: bool) -> None:
        """Mark these spheres as holding tissue or not.

        Spheres pass through the held organs, so all force goes through the anchors.
        """
        self._probe.hold(spheres, held=held)
        numbers: list[int] = spheres.tolist()
        for hold in self._holds:
            for sphere in numbers:
                hold.organ.let_touch(self._probe.bodies[sphere], on=not held)

    def _events(self, event: str, t: int) -> tuple[TissueGrasp, ...]:
        header, force = Header(stamp=Time.from_ns(t), frame_id="world"), float(np.linalg.norm(self._pull))
        return tuple(
            TissueGrasp(
                header=header,
                event=event,
                body=hold.organ.name,
                nodes=hold.nodes.astype(np.uint32),
                force_n=force,
            )
            for hold in self._holds
        )

    def _write_outputs(self, events: tuple[TissueGrasp, ...]) -> None:
        name = self._probe.name
        self._held[0] = float(bool(self._holds))
        self.outputs = {
            f"{name}/held": self._held,
            f"{name}/pull": self._pull,
            f"{name}/lift": self._lift,
            f"{name}/events": events,
        }
