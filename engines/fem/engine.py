"""Soft tissue in finite elements of our own, pressed by probes through power bonds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from engines.fem.attachments.attachments import Attachments, attachment_ports
from engines.fem.blood.blood import Blood, bleeds, blood_ports
from engines.fem.boxes import box_rows
from engines.fem.edges import Scissors, closing_rates
from engines.fem.heat.heating import Heating, heat_ports
from engines.fem.layer_outputs import LayerOutputs, layer_ports
from engines.fem.organ import Organ, relaxation
from engines.fem.params import FemParams
from engines.fem.probe import Probe
from engines.fem.spheres import MOST_CONTACTS, Spheres, near_faces
from engines.fem.sub_steps import common_sub_steps, own_sub_steps
from engines.fem.tissue_events import change_ports
from engines.fem.together import Together
from engines.tissue.elasticity.body_yield import BodyYield
from engines.tissue.ports import node_ports, node_states, surface_changes, surface_ports
from engines.tissue.probes.grasp import Grasp, grasp_ports, nothing_held
from engines.tissue.probes.near_faces import BAND_M, CONTACT_PERIOD_NS
from engines.tissue.probes.place import Surface
from engines.tissue.probes.sub_grid import warn_beyond
from engines.tissue.warn_once import warn_once
from hub.participant import (
    BondPlan,
    Inputs,
    Outputs,
    Params,
    Setup,
    Stepped,
    Value,
    join_saved,
    split_saved,
    state_hash,
)
from schemas.errors import ScenarioError, StateError
from schemas.ports import BondSide, Port

__all__ = ["FemEngine"]


class FemEngine(Stepped):
    """Soft organs in explicit dynamics; every probe is the force side of a bond.

    The state hash covers the displacements, the probes and their bonds at every step.
    """

    params_model: ClassVar[type[Params]] = FemParams
    params: FemParams

    def __init__(self, name: str, params: FemParams) -> None:
        super().__init__(name, params)
        self._organs: list[Organ] = []
        self._probes: list[Probe] = []
        self._grasps: list[tuple[Grasp, Probe]] = []
        self._unused: dict[str, Value] = {}
        """Outputs of grasping probes without a bond."""
        self._bonded: dict[str, BondPlan] = {}
        self._surfaces: list[Surface] = []
        self._heating: Heating | None = None
        self._layers: list[LayerOutputs | None] = []
        """Outputs of each organ with layers."""
        self._blades: list[tuple[int, int]] = []
        """Spheres at the ends of all edges."""
        self._scissors: list[Scissors] = []
        self._together: Together | None = None
        self._blood: Blood | None = None
        self._attachments: Attachments | None = None
        self._warn_of_coupling()

    @property
    def ports(self) -> tuple[Port, ...]:
        """Nodes of every organ, changed surfaces, events, layers, grasps of probes with fingers, and heat."""
        grasping = (name for name, probe in self.params.probes.items() if probe.grasp)
        grasps = (port for name in grasping for port in grasp_ports(name))
        changes = (*surface_ports(self.params), *change_ports(self.params.organs))
        surfaces = changes if self.params.changes_surfaces else ()
        layers = layer_ports(self.params.organs, self.params.node_period)
        layers += attachment_ports(self.params.attachments, self.params.node_period)
        heat, blood = heat_ports(self.params), blood_ports(self.params)
        return *node_ports(self.params), *surfaces, *layers, *grasps, *heat, *blood

    @property
    def bonds(self) -> tuple[BondSide, ...]:
        """Every probe: a frame, or the centres of the probe's spheres."""
        return tuple(self._bond(name) for name in self.params.probes)

    def configure(self, setup: Setup) -> Outputs:
        """Build the organs and let them settle. Raises ScenarioError for unfit periods."""
        self._check(setup.period_ns)
        self._warn_of_coarse_forces(setup.bonds)
        boxes = box_rows(self.params.rigid.values())
        is_carried = bool(len(boxes)) or (self.params.organ_contact and len(self.params.organs) > 1)
        for name, organ in self.params.organs.items():
            self._organs.append(Organ(name, organ, boxes, is_carried=is_carried))
        self._settle()
        timestep = self.params.timestep
        fewest = 1 if timestep is None else -(-setup.period_ns // timestep)
        self._sub_steps = self._plan(setup.period_ns * 1e-9, fewest)
        if any(self.params.has_series(name) for name in setup.bonds):
            self._surfaces = [
                Surface(organ, self.params.organs[organ.name].relaxed, BodyYield) for organ in self._organs
            ]
        self._bonded = dict(setup.bonds)
        return self._begin()

    def _plan(self, seconds: float, fewest: int = 1) -> int:
        """Set the sub-steps of all organs in a step of `seconds`, `fewest` at least; return their number."""
        longest = [organ.solid.longest_step for organ in self._organs]
        plan = common_sub_steps(seconds, longest, fewest)
        if self.params.own_sub_steps:
            names = [organ.name for organ in self._organs]
            nodes = [len(organ.nodes) for organ in self._organs]
            pairs = (attachment.organs for attachment in self.params.attachments.values())
            tied = [(names.index(one), names.index(other)) for one, other in pairs]
            plan = own_sub_steps(seconds, longest, plan.total, nodes, tied)
        for organ, every in zip(self._organs, plan.every, strict=True):
            organ.every = every
        return plan.total

    def _settle(self) -> None:
        """Let the organs come to rest, side by side where they touch."""
        if self.params.organ_contact:
            self._together = Together(self._organs)
            if self.params.attachments:
                self._attachments = Attachments(self.params.attachments, self._organs, self.params.organs)
                self._together.attach(self._attachments)
            self._together.settle(self.params.gravity, self._plan)
        else:
            for organ in self._organs:
                organ.settle(self.params.gravity)

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Press the organs along the predicted motion; return the reactions, and the nodes when due."""
        seconds, end = h * 1e-9, t + h
        for grasp, probe in self._grasps:
            if probe.leaves(inputs):
                grasp.take_away(t)
        for probe in self._probes:
            probe.begin(inputs, seconds)
        path = self._spheres.path
        closing = closing_rates(self._scissors, self._blades, path[0], path[-1], seconds)
        for organ in self._organs:
            organ.sharpen(closing)
        if self._attachments is not None:
            self._attachments.begin(closing)
        if self._together is None:
            for organ in self._organs:
                organ.advance(seconds, self.params.gravity)
        else:
            self._together.advance(seconds, self.params.gravity)
        self._spheres.sum_forces(organ.forces for organ in self._organs)
        are_finite = [probe.end() for probe in self._probes]
        due, touch = end % self.params.node_period == 0, end // CONTACT_PERIOD_NS != t // CONTACT_PERIOD_NS
        if due or touch or not all(are_finite):
            for organ in self._organs:
                organ.sample(end)  # an unstable organ ends the session
        outputs = (self._pictured(end) if due else {}) | self._unused
        for probe in self._probes:
            outputs.update(probe.outputs)
        if touch:
            for organ in self._organs:
                organ.tear()
            self._look()
        for grasp, _ in self._grasps:
            grasp.update(end, looked=touch)
            outputs.update(grasp.outputs)
        if self._heating is not None:
            self._heating.follow()
            outputs.update(self._heating.step(inputs, t, h))
        if self._attachments is not None:
            self._attachments.follow(() if self._heating is None else self._heating.heats)
        if self._blood is not None:
            outputs.update(self._blood.step(inputs, end, h, looked=touch))
            outputs.update(self._blood.pictures(end) if due else {})
        for organ in self._changing:
            outputs[f"{organ.name}/events"] = organ.events.finish(end)
            outputs.update(organ.sums)
        return outputs

    @property
    def _changing(self) -> list[Organ]:
        """Organs whose surface may change."""
        return self._organs if self.params.changes_surfaces else []

    def _pictured(self, t: int) -> dict[str, Value]:
        """Return nodes, changed surfaces and layers of all organs at `t` ns."""
        changes = surface_changes(self._organs, t) if self.params.changes_surfaces else {}
        outputs = node_states(self._organs, t) | changes
        for i, layers in enumerate(self._layers):
            if layers is not None:
                outputs |= layers.outputs(None if self._heating is None else self._heating.heats[i].dead)
        return outputs if self._attachments is None else outputs | self._attachments.outputs(t)

    def state_hash(self) -> int:
        """Return 64 bits of the displacements, and of the probes and grasps."""
        return state_hash(
            *(probe.digest for probe in self._probes),
            *(grasp.numbers for grasp, _ in self._grasps),
            *(organ.digest for organ in self._organs),
            *(array.tobytes() for array in (*self._heat_state, *self._blood_amounts, *self._openings)),
        )

    def save(self) -> bytes:
        """Return the bytes of all arrays, organs first."""
        return join_saved(*(part.tobytes() for part in self._parts()))

    def restore(self, state: bytes) -> None:
        """Go back to a saved state, bit for bit.

        Raises StateError for the state of other organs or probes.
        """
        try:
            self._restore_parts(iter(split_saved(self.name, sum(1 for _ in self._parts()), state)))
        except ValueError as error:
            raise StateError(
                f"participant '{self.name}': a saved state of {len(state)} bytes does not fit: {error}; was"
                " it saved elsewhere?"
            ) from error

    def _restore_parts(self, parts: Iterator[bytes]) -> None:
        for organ in self._organs:
            organ.restore(parts)
        if self._together is not None:
            self._together.forget()
        if self._attachments is not None:
            self._attachments.restore(np.frombuffer(next(parts)))
        if self._heating is not None:
            self._heating.restore(parts)
        if self._blood is not None:
            self._blood.restore(parts)
        for probe in self._probes:
            probe.numbers = np.frombuffer(next(parts))
        for grasp, probe in self._grasps:
            held = ((organ, organ.held_by(probe.bodies)) for organ in self._organs)
            grasp.resume(
                np.frombuffer(next(parts)), [(organ, nodes, nodes) for organ, nodes in held if nodes]
            )

    def _parts(self) -> Iterator[NDArray[np.generic]]:
        """Yield the parts of a saved state in order."""
        for organ in self._organs:
            yield from organ.parts
        yield from self._openings
        if self._heating is not None:
            yield from self._heating.state
        yield from self._blood_state
        yield from (probe.numbers for probe in self._probes)
        yield from (grasp.numbers for grasp, _ in self._grasps)

    @property
    def _heat_state(self) -> tuple[NDArray[Any], ...]:
        return () if self._heating is None else self._heating.state

    @property
    def _openings(self) -> tuple[NDArray[Any], ...]:
        return () if self._attachments is None else (self._attachments.widest,)

    @property
    def _blood_amounts(self) -> tuple[NDArray[Any], ...]:
        return () if self._blood is None else self._blood.amounts

    @property
    def _blood_state(self) -> tuple[NDArray[Any], ...]:
        return () if self._blood is None else self._blood.state

    def close(self) -> None:
        """Forget the organs."""
        self._heating = self._together = self._blood = self._attachments = None
        for kept in (self._organs, self._probes, self._grasps, self._surfaces, self._layers):
            kept.clear()

    def _begin(self) -> Outputs:
        """Make the probes of the bonds beside the settled organs; return the outputs at time 0."""
        self._layers = [
            LayerOutputs(organ, params) if params.layers else None
            for organ, params in zip(self._organs, self.params.organs.values(), strict=True)
        ]
        outputs = self._pictured(0)
        self._unused = {
            port: value
            for name, probe in self.params.probes.items()
            if probe.grasp and name not in self._bonded
            for port, value in nothing_held(name).items()
        }
        outputs.update(self._unused)
        bonds = [bond for bond in self.bonds if bond.name in self._bonded]
        radii = [self.params.probes[bond.name].radii for bond in bonds]
        names = [bond.name for bond, own in zip(bonds, radii, strict=True) for _ in own]
        self._spheres = Spheres(np.concatenate([np.zeros(0), *radii]), self._sub_steps, names)
        series = [relaxation(organ) for organ in self.params.organs.values()]
        first, blades, scissors = 0, self._blades, self._scissors
        for bond in bonds:
            name, params = bond.name, self.params.probes[bond.name]
            surfaces = self._surfaces if self.params.has_sub_grid(name) else None
            probe = Probe(params, bond, self._bonded[name], self._spheres, first, surfaces, series)
            if pair := params.scissors:
                scissors.append(Scissors(len(blades), len(blades) + 1, first + pair.hinge))
            blades += [(first + a, first + b) for a, b in params.edges]
            first += len(probe.radii)
            self._probes.append(probe)
            outputs.update(probe.outputs)
            if params.grasp:
                self._grasps.append((Grasp(params.grasp, probe, self._organs, self._surfaces), probe))
                outputs.update(nothing_held(name))
        for organ in self._organs:
            organ.meet(self._spheres, blades, scissors)
        for probe in self._probes:
            self._carry(probe)
        if self._attachments is not None:
            self._attachments.meet(self._spheres, blades, scissors)
        for organ in self._changing:
            outputs |= {f"{organ.name}/events": (), **organ.sums}
        if any(self.params.probes[bond.name].energy for bond in bonds):
            self._heating = Heating(self.params, self._organs, self._probes, self._attachments)
            outputs.update(self._heating.outputs)
        if any(map(bleeds, self.params.organs.values())):
            self._blood = Blood(self.params, self._organs, self._probes)
            outputs.update(self._blood.outputs | self._blood.pictures(0))
        return outputs

    def _carry(self, probe: Probe) -> None:
        """Tie the nodes of organs that are anchored to a probe; the probe's sphere touches nothing then."""
        carried, (body, *_) = self.params.carried(probe.name), probe.bodies
        for organ in self._organs if carried else ():
            organ.let_touch(body, on=False)
            for node in np.flatnonzero(carried.get(organ.name, False)).tolist():
                organ.anchor(node, body)
        if carried:
            probe.hold(np.arange(1), held=True)

    def _look(self) -> None:
        """Find the faces near each probe; set what touches, and the laws of springs in series."""
        for probe in self._probes:
            loose = np.flatnonzero(~probe.held)
            touched = probe.radii[loose] + BAND_M
            reach, centres = np.maximum(touched, probe.sight), probe.positions[loose]
            near = [near_faces(centres, reach, organ.nodes, organ.touchable) for organ in self._organs]
            probe.touching[:] = False
            for spheres, _, _, distances in near:
                probe.touching[loose[spheres[distances < touched[spheres]]]] = True
            for spheres, *_ in near:
                if len(spheres) > MOST_CONTACTS and np.bincount(spheres).max() > MOST_CONTACTS:
                    self._warn_of_fine_faces(probe)
            probe.follow(near)
            if probe.sub_grid is not None and probe.sub_grid.is_beyond:
                warn_beyond(self.name, probe.name, float(probe.radii[0]))

    def _warn_of_fine_faces(self, probe: Probe) -> None:
        warn_once(
            f"participant '{self.name}', probe '{probe.name}': a sphere is near more than {MOST_CONTACTS}"
            " faces, and touches no more: take a coarser mesh, or smaller spheres"
        )

    def _warn_of_coarse_forces(self, bonds: Iterable[str]) -> None:
        """Warn where rigid parts take the correction of the force from a probe of one sphere."""
        bonded = [self.params.probes[name] for name in bonds]
        is_single = any(probe.spheres in (None, 1) and probe.grasp is None for probe in bonded)
        if is_single and self.params.sub_grid and self.params.may_lean:
            warn_once(
                f"participant '{self.name}': organs may lean on {', '.join(self.params.rigid)}, so a probe of"
                " one sphere feels the force of the mesh, too large if the mesh is coarse: take more nodes,"
                " tie the organs to it, or set sub_grid: false"
            )

    def _warn_of_coupling(self) -> None:
        """Warn of parameters that mean a virtual coupling, which this engine does not have."""
        for name, probe in self.params.probes.items():
            stated = [key for key in ("stiffness", "mass", "damping") if getattr(probe, key) is not None]
            if stated:
                warn_once(
                    f"participant '{self.name}', probe '{name}': {', '.join(stated)} of a virtual coupling"
                    " without effect in kind fem, whose spheres go where the instrument goes: leave out, or"
                    " take kind bullet"
                )

    def _bond(self, name: str) -> BondSide:
        probe = self.params.probes[name]
        return BondSide(
            name=name,
            side="force",
            dof=6 if probe.spheres is None else 3,
            points=probe.spheres or 1,
            frame="world",
            contact_stiffness=self.params.contact_stiffness(name),
        )

    def _check(self, period_ns: int) -> None:
        if self.params.node_period % period_ns:
            raise ScenarioError(
                f"participant '{self.name}': node_period {self.params.node_period} ns is no multiple of the"
                f" period {period_ns} ns"
            )
