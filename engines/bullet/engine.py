"""Soft tissue in PyBullet, pressed by probes through power bonds."""

from __future__ import annotations

from math import ceil, pi, sin
from typing import ClassVar

from engines.bullet.elasticity.stable_step import ACCURATE_PHASE, face_loss, longest_step
from engines.bullet.organ import Organ
from engines.bullet.params import BulletParams
from engines.bullet.probes.contact_gain import Contacts, Tissue
from engines.bullet.probes.probe import Probe
from engines.bullet.world import add_rigid, connect, disconnect
from engines.tissue.ports import node_ports, node_states
from engines.tissue.probes.grasp import Grasp, grasp_ports, nothing_held
from engines.tissue.probes.near_faces import CONTACT_PERIOD_NS
from engines.tissue.probes.params import Coupling, ProbeParams
from engines.tissue.probes.place import Surface
from engines.tissue.probes.sub_grid import SubGrid, warn_beyond
from engines.tissue.warn_once import warn_once
from hub.participant import (
    BondPlan,
    Inputs,
    Outputs,
    Params,
    Setup,
    Stepped,
    Tunables,
    Value,
    state_hash,
    tunable_in,
)
from schemas.errors import ScenarioError, StateError
from schemas.ports import BondSide, Port
from schemas.vectors import Vector

__all__ = ["BulletEngine"]

_RAMP_S = 0.2
"""Time of growing gravity before time 0, at least two periods of the slowest organ; then the organs rest for
half of this time.
"""

_GRAVITY_DIGITS = 6
"""Digits of the growing gravity: sines differ in their last bit between processors."""

_NO_CLIENT = -1


class BulletEngine(Stepped):
    """Soft organs in PyBullet; every probe is the force side of a bond.

    The state hash covers the probes and their bonds at every step, and the nodes at their last reading, every
    8 ms and at every output: reading the nodes at every step would cost a quarter of the step's time.
    """

    params_model: ClassVar[type[Params]] = BulletParams
    params: BulletParams

    def __init__(self, name: str, params: BulletParams) -> None:
        super().__init__(name, params)
        self._client = _NO_CLIENT
        self._organs: list[Organ] = []
        self._probes: list[Probe] = []
        self._grasps: list[Grasp] = []
        self._sub_grids: list[tuple[Probe, SubGrid]] = []
        self._surfaces: list[Surface] = []
        self._tissues: list[Tissue] = []
        self._bonded: dict[str, BondPlan] = {}
        self._settled: list[Vector] = []
        """Nodes of each organ at the start, m, shape (n, 3)."""
        self._at_start = False
        self._unused: dict[str, Value] = {}
        """Outputs of grasping probes without a bond."""

    @property
    def ports(self) -> tuple[Port, ...]:
        """The nodes of every organ; of every probe the stiffness and, with fingers, the grasp."""
        couplings = (self._stiffness_port(name) for name in self.params.probes)
        grasping = (name for name, probe in self.params.probes.items() if probe.grasp)
        return (
            *node_ports(self.params),
            *couplings,
            *(port for name in grasping for port in grasp_ports(name)),
        )

    def _stiffness_port(self, probe: str) -> Port:
        coupling = self._coupling(probe)
        return tunable_in(
            f"{probe}/stiffness",
            coupling.stiffness,
            (coupling.least_stiffness, coupling.stiffness),
            "of the virtual coupling between the probe's proxies and the instrument",
            unit="N/m",
        )

    @property
    def bonds(self) -> tuple[BondSide, ...]:
        """Every probe: a frame, or the centres of the probe's spheres."""
        return tuple(self._bond(name, probe) for name, probe in self.params.probes.items())

    def configure(self, setup: Setup) -> Outputs:
        """Load the organs, settle, and add a proxy for every bond.

        Raises ScenarioError for too long a step.
        """
        self._check_steps(setup.period_ns)
        dt = self.params.sub_step * 1e-9
        self._dt = dt
        self._client = client = connect(f"participant '{self.name}' (kind bullet)", dt, self.params.gravity)
        import pybullet as bullet

        self._simulate = bullet.stepSimulation
        parts = {name: add_rigid(part, client) for name, part in self.params.rigid.items()}
        for name, organ in self.params.organs.items():
            self._organs.append(Organ(name, organ, client, parts))
        self._check_tissue()
        if setup.bonds:
            self._warn_of_long_step()
        self._settle()
        self._read_nodes(0)
        self._settled = [organ.nodes for organ in self._organs]
        self._bonded = dict(setup.bonds)
        self._surfaces = self._loaded_surfaces()
        self._tissues = [self._tissue(organ) for organ in self._organs]
        return self._begin()

    def _begin(self) -> Outputs:
        """Add a proxy for every bond to the settled organs; return the outputs at time 0."""
        for bond in self.bonds:
            if plan := self._bonded.get(bond.name):
                probe = self.params.probes[bond.name]
                self._probes.append(
                    Probe(probe, self._coupling(bond.name), bond, plan, self.params.gravity, self._client)
                )
        self._tunables = Tunables(self.ports)
        self._add_sub_grid()
        for tissue in self._tissues:
            tissue.advance()
        self._contacts = Contacts(self._tissues)
        outputs = node_states(self._organs, 0)
        self._unused = {
            port: value
            for name, probe in self.params.probes.items()
            if probe.grasp and name not in self._bonded
            for port, value in nothing_held(name).items()
        }
        outputs.update(self._unused)
        for probe in self._probes:
            outputs.update(probe.idle)
            if grasp := self.params.probes[probe.name].grasp:
                self._grasps.append(Grasp(grasp, probe, self._organs, self._surfaces))
                outputs.update(self._grasps[-1].outputs)
        self._at_start = self.params.standstill
        return outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Press the probes along their predicted motion; return their reactions, and the nodes when due."""
        seconds, dt, probes = h * 1e-9, self._dt, self._probes
        self._at_start = False
        for name, value in self._tunables.changes(inputs):
            self._set_stiffness(name, value)
        for probe in probes:
            probe.begin(inputs, seconds)
        for i in range(h // self.params.sub_step):
            for probe in probes:
                probe.push((i + 0.5) * dt, dt)
            self._simulate(physicsClientId=self._client)
            for probe in probes:
                probe.read(dt)
        end = t + h
        due, touch = end % self.params.node_period == 0, end // CONTACT_PERIOD_NS != t // CONTACT_PERIOD_NS
        if due or touch:
            self._read_nodes(end)
        if touch:
            self._contacts.update(self._probes)
            for probe, sub_grid in self._sub_grids:
                self._follow(probe, sub_grid)
        outputs = (node_states(self._organs, end) if due else {}) | self._unused
        for probe in probes:
            outputs.update(probe.result(end, seconds))
        for grasp in self._grasps:
            grasp.update(end, looked=touch)
            outputs.update(grasp.outputs)
        return outputs

    def _set_stiffness(self, port: str, stiffness: float) -> None:
        for probe in self._probes:
            if port == f"{probe.name}/stiffness":
                probe.set_stiffness(stiffness)

    def state_hash(self) -> int:
        """Return 64 bits of the probes' positions, velocities and bonds, and of the nodes as last read."""
        keepers = (*self._probes, *self._grasps)
        return state_hash(
            *(part for keeper in keepers for part in keeper.state), *(organ.nodes for organ in self._organs)
        )

    def save(self) -> bytes:
        """Return a mark of the start. Raises StateError later: Bullet gives no velocities of nodes."""
        if not self._at_start:
            raise StateError(self._no_state)
        return self._start_mark

    def restore(self, state: bytes) -> None:
        """Go back to the start, bit for bit; raises StateError for a state of other organs."""
        if state != self._start_mark:
            raise StateError(self._no_state)
        for grasp in self._grasps:
            grasp.untie()
        for probe in self._probes:
            probe.remove()
        self._probes.clear()
        self._grasps.clear()
        self._sub_grids.clear()
        for organ, nodes in zip(self._organs, self._settled, strict=True):
            organ.stand(nodes)
        self._read_nodes(0)
        self._begin()

    @property
    def _start_mark(self) -> bytes:
        return state_hash(*self._settled).to_bytes(8, "little")

    def close(self) -> None:
        """Close the world."""
        if self._client != _NO_CLIENT:
            disconnect(self._client)
        self._client = _NO_CLIENT
        self._organs.clear()
        self._probes.clear()
        self._grasps.clear()
        self._sub_grids.clear()
        self._settled.clear()
        self._at_start = False

    @property
    def _no_state(self) -> str:
        return (
            f"participant '{self.name}': Bullet gives no velocities of soft bodies, so only the start can be"
            " saved, unless `standstill` is false, and restored with the same organs. Re-simulate from the"
            " recorded grants instead"
        )

    def _loaded_surfaces(self) -> list[Surface]:
        """Return the surfaces of all organs, if a probe has something in series with their meshes."""
        if not any(self.params.has_series(name) for name in self._bonded):
            return []
        return [Surface(organ, self.params.organs[organ.name].elastic) for organ in self._organs]

    def _add_sub_grid(self) -> None:
        """Give probes of a single sphere the spring in series, if all organs are anchored and small."""
        for probe in self._probes:
            if self.params.has_sub_grid(probe.name):
                probe.sub_grid = SubGrid(float(probe.radii[0]), probe.coupling, self._surfaces)
                self._sub_grids.append((probe, probe.sub_grid))

    def _follow(self, probe: Probe, sub_grid: SubGrid) -> None:
        sub_grid.update(probe.positions[0], probe.forces[0], probe.near)
        if sub_grid.is_beyond:
            warn_beyond(self.name, probe.name, float(probe.radii[0]))

    def _tissue(self, organ: Organ) -> Tissue:
        return Tissue(organ, self.params.organs[organ.name].elastic, self.params.gravity)

    def _coupling(self, probe: str) -> Coupling:
        params, timestep = self.params.probes[probe], self.params.sub_step * 1e-9
        organs = [organ.elastic for organ in self.params.organs.values()]
        damping = min(material.damping for material in organs)
        if self.params.has_sub_grid(probe):
            stiffest = max(material.contact_stiffness(float(params.radii[0])) for material in organs)
            return params.coupling(stiffest, damping, timestep, sub_grid=True)
        return params.coupling(self.params.contact_stiffness(probe), damping, timestep)

    def _bond(self, name: str, probe: ProbeParams) -> BondSide:
        coupling = self._coupling(name)
        return BondSide(
            name=name,
            side="force",
            dof=6 if probe.spheres is None else 3,
            points=probe.spheres or 1,
            frame="world",
            stiffness=coupling.stiffness,
            damping=coupling.damping,
            proxy_mass=coupling.mass,
            proxy_step=self.params.sub_step * 1e-9,
            contact_stiffness=(
                coupling.stiffness if self.params.has_sub_grid(name) else self.params.contact_stiffness(name)
            ),
        )

    def _read_nodes(self, t: int) -> None:
        for organ in self._organs:
            organ.sample(t)

    def _settle(self) -> None:
        """Increase gravity slowly: applied at once, gravity would make the organs swing for long.

        Gravity grows like the integral of a Hann window, with a spectrum below 3 % from two periods per
        window on. Remaining motion is stopped, so the start can be restored, unless `standstill` is false.
        """
        import pybullet as bullet

        ramp = max(_RAMP_S, *(2.0 * organ.period for organ in self._organs))
        steps = ceil(1.5 * ramp / self._dt)
        for i in range(steps):
            s = min(1.0, 1.5 * (i + 1) / steps)
            share = round(s - sin(2.0 * pi * s) / (2.0 * pi), _GRAVITY_DIGITS)
            bullet.setGravity(0.0, 0.0, -self.params.gravity * share, physicsClientId=self._client)
            self._simulate(physicsClientId=self._client)
        for organ in self._organs if self.params.standstill else ():
            organ.stand()

    def _check_steps(self, period_ns: int) -> None:
        params, where = self.params, f"participant '{self.name}'"
        if period_ns % params.sub_step:
            raise ScenarioError(
                f"{where}: timestep {params.sub_step} ns does not divide the period {period_ns} ns"
            )
        if params.node_period % period_ns:
            raise ScenarioError(
                f"{where}: node_period {params.node_period} ns is no multiple of the period {period_ns} ns"
            )
        for name in params.probes:
            longest = self._coupling(name).longest_step * 1e9
            if params.sub_step > longest * (1.0 + 1e-9):
                raise ScenarioError(
                    f"{where}, probe '{name}': timestep {params.sub_step} ns is above 0.5 sqrt(mass /"
                    f" stiffness) = {longest:.0f} ns, up to which the virtual coupling is stable. Shorten it,"
                    " or take a heavier or softer probe"
                )

    def _check_tissue(self) -> None:
        for organ in self._organs:
            limit = longest_step(organ.frequency, self.params.organs[organ.name].elastic.damping)
            if self._dt > limit:
                raise ScenarioError(
                    f"participant '{self.name}', organ '{organ.name}': timestep {self.params.sub_step} ns is"
                    f" above {limit * 1e9:.0f} ns, up to which tissue with a highest natural frequency of"
                    f" {organ.frequency:.0f} rad/s is stable. Shorten it, raise the damping, or take fewer"
                    " nodes"
                )

    def _warn_of_long_step(self) -> None:
        """Warn where the sub-step is stable but takes more than a tenth of the force of contacts.

        Tools that grasp hold the tissue after a short contact: held tissue has its full forces.
        """
        if all(probe.grasp is not None for probe in self.params.probes.values()):
            return
        for organ in self._organs:
            phase = self._dt * organ.frequency
            if phase > ACCURATE_PHASE:
                warn_once(
                    f"participant '{self.name}', organ '{organ.name}': with a timestep of"
                    f" {self.params.sub_step / 1e6:g} ms forces of contact are up to some"
                    f" {face_loss(phase):.0%} too small over faces of the mesh (not where a tool holds the"
                    f" tissue); up to {ACCURATE_PHASE / organ.frequency * 1e3:.2g} ms they are within 10 %"
                )
