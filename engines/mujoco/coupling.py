"""The power bonds of the engine: made for the scenario's plan, and stepped together.

A probe, contact spheres, a needle's wire or a joint is one side of a bond; the other side is in another
engine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

import mujoco
import numpy as np

from engines.mujoco.arms.exchange import Exchange
from engines.mujoco.arms.servos import Servos
from engines.mujoco.interaction.contact_spheres_bond import ContactSpheresBond
from engines.mujoco.interaction.holding import Holding
from engines.mujoco.interaction.joint_bond import JointBond
from engines.mujoco.interaction.probe_bond import ProbeBond
from engines.mujoco.interaction.rigid_contact import RigidContact
from engines.mujoco.interaction.wire_bond import WireBond
from engines.mujoco.object_params import NeedleParams
from engines.mujoco.params import MujocoParams
from engines.mujoco.ports import WIRE
from hub.participant import BondPlan, Inputs, MotionSide, Value
from robots.dvrk.setup_joints import CartArm
from schemas.errors import ScenarioError
from schemas.ports import BondSide
from schemas.vectors import Vector

__all__ = ["Coupling"]

_KINDS = {"probe": ProbeBond, "contact": ContactSpheresBond}


class Coupling:
    """Bonds at instruments, needles and joints.

    Attributes:
        touching: the bonds of the scenario.
        renewed: bonds that act anew in each sub-step.
        effective_mass: least mass that a blow meets, kg, by name of every possible bond.
        outputs: views of what the bonds measure, by port.
    """

    def __init__(
        self,
        engine: str,
        params: MujocoParams,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        servos: Servos,
        exchange: Exchange,
    ) -> None:
        """Make no bond yet; `engine` is the participant's name."""
        self._engine, self._params, self._model, self._data = engine, params, model, data
        self._servos, self._exchange = servos, exchange
        self.touching: list[ProbeBond | ContactSpheresBond | WireBond | JointBond] = []
        self.renewed: list[ProbeBond | ContactSpheresBond | WireBond | JointBond] = []
        self.effective_mass: dict[str, float] = {}
        self.outputs: dict[str, Value] = {}
        self._wires: list[WireBond] = []
        self._felt_by_spares: list[tuple[Vector, ProbeBond | ContactSpheresBond]] = []
        """`tip_wrench` of an arm with spares, and one of the bonds that it sums."""
        self._felt: dict[str, Vector] = {}
        self._untouched: list[Vector] = []

    def couple(self, bonds: Sequence[BondSide], plans: Mapping[str, BondPlan]) -> None:
        """Find the effective mass of all `bonds`, and make those that have a plan."""
        joints: Mapping[str, Sequence[str]] = {**self._params.bonded_joints}
        for bond in bonds:
            owner, _, kind = bond.name.rpartition("/")
            plan = plans.get(bond.name)
            if kind == WIRE:
                self._couple_needle(owner, bond, plan)
            elif kind in joints.get(owner, ()):
                self._couple_joint(owner, kind, bond, plan)
            else:
                self._couple_instrument(owner, kind, bond, plan)
        bonded = {one.bond.partition("/")[0] for one in self.touching if not isinstance(one, JointBond)}
        felt = {arm: self.outputs.get(f"{arm}/tip_wrench") for arm in self._params.arms}
        self._felt = {arm: cast("Vector", wrench) for arm, wrench in felt.items() if wrench is not None}
        self._untouched = [wrench for arm, wrench in self._felt.items() if arm not in bonded]
        self.renewed = [
            touching
            for touching in self.touching
            if touching.acts_off_centre or plans[touching.bond].correction is not None
        ]

    def _couple_instrument(self, owner: str, kind: str, bond: BondSide, plan: BondPlan | None) -> None:
        arm = owner.partition("/")[0]
        if owner != arm:
            self.mount(arm, self._exchange.owners[arm].index(owner))
        self.effective_mass[bond.name] = _KINDS[kind].least_mass(owner, self._model, self._data)
        if owner != arm:
            self.mount(arm, 0)
        felt = self.outputs.setdefault(f"{arm}/tip_wrench", np.zeros(6))
        if plan:
            touching = _KINDS[kind](owner, MotionSide(bond, plan), self._model, self._data)
            self.touching.append(touching)
            self.outputs.update(touching.outputs)
            if arm in self._exchange.engaged:
                self.outputs[f"{arm}/tip_wrench"] = felt
                self._felt_by_spares.append((cast("Vector", felt), touching))

    def _couple_needle(self, thing: str, bond: BondSide, plan: BondPlan | None) -> None:
        params = cast("NeedleParams", self._params.objects[thing])
        self.effective_mass[bond.name] = WireBond.least_mass(thing, params, self._model, self._data)
        if plan:
            wire = WireBond(thing, params, MotionSide(bond, plan), self._model, self._data)
            self.touching.append(wire)
            self._wires.append(wire)
            self.outputs.update(wire.outputs)

    def _couple_joint(self, arm: str, joint: str, bond: BondSide, plan: BondPlan | None) -> None:
        if plan is None:
            problem = f"joint '{bond.name}' has no drive: bond '{self._engine}.{bond.name}' to a force side"
            raise ScenarioError(problem, path=("participants", self._engine, "bonded_joints"))
        self.effective_mass[bond.name] = JointBond.least_mass(bond.name, self._model, self._data)
        number = [one.name for one in self._params.arms[cast("CartArm", arm)].chain.joints].index(joint)
        goal = self._servos.arm_setpoint(arm)[number : number + 1]
        driven = JointBond(bond.name, MotionSide(bond, plan), goal, self._model, self._data)
        self.touching.append(driven)
        self.outputs.update(driven.outputs)

    def mount(self, arm: str, number: int) -> None:
        """Give `arm` an instrument where its servos are."""
        self._exchange.engage(arm, number)
        self._servos.engage(self._exchange.engaged)
        self._exchange.put(arm, self._servos.arm_setpoint(arm), self._servos.jaw_setpoint(arm))
        mujoco.mj_step1(self._model, self._data)

    def begin(self, inputs: Inputs) -> None:
        """Apply the forces of the other sides at the beginning of a step."""
        for touching in self.touching:
            touching.begin(inputs)

    def end(self, rigid: RigidContact | None, holding: Holding) -> None:
        """Record work, and sum the wrenches that arms feel."""
        for touching in self.touching:
            touching.end()
        for felt, _ in self._felt_by_spares:
            felt[:] = 0.0
        for felt, touching in self._felt_by_spares:
            felt += touching.tip_wrench
        if self._wires:
            self._feel_needles(rigid, holding)

    def _feel_needles(self, rigid: RigidContact | None, holding: Holding) -> None:
        """Give the bond's force on a held needle to the holding arm, as `tip_wrench`.

        The force comes through the jaws, so the arm's `rigid_wrench` is less by as much.
        """
        for wrench in self._untouched:
            wrench[:] = 0.0
        for wire in self._wires:
            arm = holding.holder(wire.thing)
            if rigid is not None and arm in self._felt:
                rigid.give(arm, wire.wrench, self._felt[arm])

    def refresh(self) -> None:
        """Read the sides again, after another instrument or a state was put in place."""
        for touching in self.touching:
            touching.refresh()
