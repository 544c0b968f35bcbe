"""The MuJoCo engine: dVRK arms, objects, power bonds at instruments, and exact checkpoints.

A sub-step is `mj_step2` (actuation to integration) followed by `mj_step1` (kinematics, velocities, sensors):
the same work as `mj_step`, in an order with every output at the end of the step instead of a sub-step behind.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from importlib.util import find_spec
from typing import TYPE_CHECKING, ClassVar, Protocol, cast

import numpy as np

from engines.mujoco.params import MujocoParams
from engines.mujoco.pictures.opengl import import_mujoco
from engines.mujoco.ports import GRAVITY, bond_sides, bonded_joints, scene_ports
from hub.participant import (
    Inputs,
    Outputs,
    Params,
    Setup,
    Stepped,
    Tunables,
    Value,
    state_hash,
)
from robots.dvrk.mounted.mounted_psm import MountedPsm
from schemas.errors import MissingExtraError, ScenarioError, SessionError, StateError
from schemas.ports import BondSide, Port
from schemas.ros import PoseStamped
from schemas.vectors import Vector

if TYPE_CHECKING:
    from engines.mujoco.arms.ahead import Ahead

__all__ = ["MujocoEngine"]


class _Keeper(Protocol):
    """A part with state beyond MuJoCo's."""

    @property
    def state(self) -> Vector: ...

    @state.setter
    def state(self, state: Vector) -> None: ...


class MujocoEngine(Stepped):
    """dVRK arms in a rigid world."""

    params_model: ClassVar[type[Params]] = MujocoParams
    params: MujocoParams

    def __init__(self, name: str, params: MujocoParams) -> None:
        super().__init__(name, params)
        self._keepers: list[_Keeper] = []
        self._effective_mass: Mapping[str, float] = {}
        self._outputs: dict[str, Value] = {}
        self._ahead: Ahead | None = None

    @property
    def ports(self) -> tuple[Port, ...]:
        """Commands and measured state of every arm, `qpos` of the whole model, and the state of every object.

        The state of an object: pose, holding arm, slip, turn and lift.
        """
        return scene_ports(self.params)

    @property
    def bonds(self) -> tuple[BondSide, ...]:
        """The sphere of every palpation probe, `<arm>/probe`, and the contact spheres of instruments.

        Contact spheres are called `<arm>/contact`; positions are the spheres' centres, in the world. Of
        needles, `<needle>/wire` is base, middle and tip; `<arm>/<joint>` is a joint driven from outside.
        """
        return tuple(
            side.model_copy(update={"effective_mass": self._effective_mass.get(side.name)})
            for side in bond_sides(self.params)
        )

    def configure(self, setup: Setup) -> Outputs:
        """Build and compile the model, and put the arms at their start positions."""
        self._check_timestep(setup.period_ns)
        if find_spec("mujoco") is None:
            raise MissingExtraError(f"participant '{self.name}' (kind mujoco)", "mujoco", "mujoco")
        import_mujoco()
        self._build_parts(setup.period_ns * 1e-9, self._build_model())
        self._build_contacts(setup.period_ns)
        self._tunables = Tunables(self.ports)
        self._coupling.couple(self.bonds, setup.bonds)
        self._effective_mass = self._coupling.effective_mass
        self._outputs.update(self._coupling.outputs)
        self._readings.refresh()
        self._holding.refresh()
        self._allocate_state()
        return self._outputs

    def _check_timestep(self, period_ns: int) -> None:
        timestep = self.params.timestep
        if period_ns % timestep:
            problem = (
                f"timestep {timestep / 1e6:g} ms does not divide the participant's period"
                f" {period_ns / 1e6:g} ms; set it to {period_ns / 1e6:g} ms or a part of it"
            )
            raise ScenarioError(problem, path=("participants", self.name, "timestep"))

    def _build_model(self) -> Vector | None:
        """Compile the model, and return the matrix of a lean model to the positions of the whole model."""
        import mujoco

        from engines.mujoco import model
        from engines.mujoco.interaction import holding
        from engines.mujoco.interaction.joint_bond import release
        from engines.mujoco.model import ties
        from engines.mujoco.model.lean import lean

        # else MuJoCo writes MUJOCO_LOG.TXT into the working directory
        mujoco.set_mju_user_warning(logging.getLogger(__name__).warning)
        spec = model.spec(self.params)
        ties.add(spec, self.params)
        holding.prepare(spec, self.params)
        for arm, joint in bonded_joints(self.params):
            release(spec, f"{arm}/{joint.name}")
        spec.option.timestep = self.params.timestep * 1e-9
        positions = None
        if self.params.lean:
            self._model, positions = lean(spec, self.params)
        else:
            self._model = spec.compile()
        self._mujoco = mujoco
        self._data = mujoco.MjData(self._model)
        model.place(self._model, self._data, self.params.arms)
        return positions

    def _build_parts(self, period: float, positions: Vector | None) -> None:
        """Make servos, readings, brakes and holding.

        Args:
            period: period of the participant, s.
            positions: for a lean model, the matrix to the positions of the whole model.
        """
        from engines.mujoco.arms.brakes import Brakes
        from engines.mujoco.arms.exchange import Exchange
        from engines.mujoco.arms.hands import Hands
        from engines.mujoco.arms.readings import Readings
        from engines.mujoco.arms.servos import Servos
        from engines.mujoco.coupling import Coupling
        from engines.mujoco.interaction.holding import Holding

        model, data, params = self._model, self._data, self.params
        self._servos = Servos(model, data, params.arms, period)
        self._exchange = Exchange(model, data, params.arms)
        self._servos.engage(self._exchange.engaged)
        self._mujoco.mj_forward(model, data)
        weighs = params.measured_effort == "motor"
        self._readings = Readings(
            model,
            data,
            params.arms,
            self._servos,
            positions,
            weighs=weighs,
            engaged=lambda: self._exchange.engaged,
        )
        self._brakes = Brakes(model, data, params)
        self._hands = Hands(model, data, params.arms, period)
        self._holding = Holding(model, data, params, params.publish_period * 1e-9)
        self._coupling = Coupling(self.name, params, model, data, self._servos, self._exchange)
        self._outputs.update({**self._readings.outputs, **self._holding.outputs, **self._hands.outputs})

    def _build_contacts(self, period_ns: int) -> None:
        """Make the sums of rigid contact forces, if the scenario wants them."""
        from engines.mujoco.interaction.rigid_contact import RigidContact

        psms = [arm for arm, params in self.params.arms.items() if isinstance(params, MountedPsm)]
        fixtures = tuple(self.params.fixtures)
        self._rigid = None
        self._at_once = self.params.rigid_wrench is not True
        if self.params.rigid_wrench and (psms or fixtures):
            every = period_ns if self._at_once else self.params.timestep
            self._rigid = RigidContact(self._model, self._data, psms, fixtures=fixtures, every=every * 1e-9)
            self._outputs.update(self._rigid.outputs)

    def _allocate_state(self) -> None:
        """Size the saved state by the model and by the parts with state of their own."""
        self._keepers = [
            *([self._exchange] if self._exchange.engaged else []),
            self._servos,
            self._brakes,
            self._holding,
            *([self._hands] if self._hands.outputs else []),
            *(touching.motion for touching in self._coupling.touching),
            *([] if self._rigid is None or self._rigid.collisions is None else [self._rigid.collisions]),
        ]
        self._no_sensors = int(self._mujoco.mjtDisableBit.mjDSBL_SENSOR)
        trouble = self._mujoco.mjtWarning
        self._trouble = self._data.warning.number.data[trouble.mjWARN_BADQPOS : trouble.mjWARN_BADCTRL + 1]
        self._signature = self._state_signature()
        self._size = self._mujoco.mj_stateSize(self._model, self._signature)
        self._state = np.empty(self._size + sum(keeper.state.size for keeper in self._keepers))

    def _state_signature(self) -> int:
        """Return the parts of MuJoCo's data to hash and save.

        Applied forces are left out without bonds: half of the numbers, all 0.
        """
        state = self._mujoco.mjtState
        applied = int(state.mjSTATE_QFRC_APPLIED | state.mjSTATE_XFRC_APPLIED)
        return int(state.mjSTATE_INTEGRATION) & ~(0 if self._coupling.touching else applied)

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Advance all arms by `h` nanoseconds. Raises SessionError if the simulation has become unstable."""
        for name, value in self._tunables.changes(inputs):
            if name == GRAVITY:
                self._set_gravity(value)
        if not inputs.quiet:
            self._place(inputs)
        if self._exchange.engaged:
            self._exchange_instruments(inputs)
        self._servos.begin(inputs)
        self._brakes.set(on="ECM" in self._servos.off)
        self._hands.begin(inputs)
        if self._rigid is None and not self._coupling.touching:
            self._sub_steps(h // self.params.timestep)
            self._mujoco.mj_step1(self._model, self._data)
        else:
            self._coupled_sub_steps(h, inputs)
        return self._finish(t, h, inputs)

    def _finish(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Read arms, objects and contacts at the end of the step from `t`."""
        self._readings.update()
        self._hands.update()
        if (t + h) % self.params.publish_period == 0:
            self._readings.refresh()
            self._holding.update()
            if self._rigid is not None:
                self._rigid.refresh()
        if any(self._trouble):
            raise SessionError(self._diagnosis(t, inputs))
        return self._outputs

    def leap(
        self, t: int, h: int, count: int, inputs: Inputs, series: Mapping[str, Vector]
    ) -> tuple[Outputs, Mapping[str, Vector]]:
        """Take several steps with a series of commands; read arms and objects at the end.

        Raises SessionError as `step` does, and where bonds, sums of contacts or events ask for single steps.
        """
        coupled = self._rigid is not None or self._coupling.touching
        if coupled or self.params.grasp != "friction" or not inputs.quiet:
            raise SessionError(
                "bonds, contact sums, events, and grasps but by friction go step by step: use `advance`"
            )
        controls = self._servos.series(inputs, count, series)
        if self._ahead is None:
            from engines.mujoco.arms.ahead import Ahead

            self._ahead = Ahead(self._model, self._data)
        states, bodies = self._ahead.run(controls, h // self.params.timestep)
        for i, near in enumerate(self._holding.are_near(bodies, count - 1)):
            if (t + (i + 1) * h) % self.params.publish_period == 0:
                if near:
                    self._ahead.show(states[i])
                self._holding.watch(near=near)
        self._ahead.finish(controls[-1])
        return self._finish(t + (count - 1) * h, h, inputs), {}

    def _set_gravity(self, gravity: float) -> None:
        """Let gravity (m/s^2, along -z) act from this step on: the last sub-step has prepared its forces."""
        self._model.opt.gravity[2] = -gravity
        self._ahead = None
        self._mujoco.mj_step1(self._model, self._data)

    def _exchange_instruments(self, inputs: Inputs) -> None:
        """Give arms the instruments asked for: the last sub-step has prepared the motion of the old ones."""
        self._exchange.hold()
        if not (asked := self._exchange.asked(inputs)):
            return
        for arm, number in asked.items():
            self._coupling.mount(arm, number)
        self._ahead = None
        self._coupling.refresh()

    def _place(self, inputs: Inputs) -> None:
        """Put objects where events say."""
        from engines.mujoco.interaction.placing import place

        for thing in self.params.objects:
            for message in inputs.events(f"{thing}/place"):
                place(self._model, self._data, thing, cast("PoseStamped", message))

    def _sub_steps(self, count: int) -> None:
        """Take sub-steps without reading or renewing between, all but the last `mj_step1`.

        Sensors are computed in the last sub-step alone.
        """
        model, data, option = self._model, self._data, self._model.opt
        self._mujoco.mj_step2(model, data)
        if count > 2:
            sensing = option.disableflags
            option.disableflags = sensing | self._no_sensors
            self._mujoco.mj_step(model, data, count - 2)
            option.disableflags = sensing
        if count > 1:
            self._mujoco.mj_step(model, data)

    def _coupled_sub_steps(self, h: int, inputs: Inputs) -> None:
        """Take the sub-steps of `h` nanoseconds, and sum the effects of bonds and contacts."""
        self._coupling.begin(inputs)
        if self._at_once and not self._coupling.renewed:
            self._sub_steps(h // self.params.timestep)
            if self._rigid is not None:
                self._rigid.add()
            self._mujoco.mj_step1(self._model, self._data)
        else:
            self._watched_sub_steps(h)
        if self._rigid is not None:
            self._rigid.end()
        self._coupling.end(self._rigid, self._holding)

    def _watched_sub_steps(self, h: int) -> None:
        """Take the sub-steps of `h` nanoseconds; renew bonds, and sum forces of contacts in between."""
        model, data, step1, step2 = self._model, self._data, self._mujoco.mj_step1, self._mujoco.mj_step2
        add_rigid = (lambda: None) if self._rigid is None else self._rigid.add
        for tau in range(0, h, self.params.timestep):
            if tau:
                for touching in self._coupling.renewed:
                    touching.renew(tau * 1e-9)
            step2(model, data)
            add_rigid()
            step1(model, data)

    def _diagnosis(self, t: int, inputs: Inputs) -> str:
        bad = self._mujoco.mjtWarning(
            self._mujoco.mjtWarning.mjWARN_BADQPOS + list(map(bool, self._trouble)).index(True)
        )
        where = f"MuJoCo reports {bad.name} in the step from {t * 1e-9:g} s"
        signals = (p for p in self.ports if (p.causality, p.variability) == ("input", "signal"))
        read = [p.name for p in signals if p.limits is None]
        for port in read + [touching.motion.force_port for touching in self._coupling.touching]:
            if not np.isfinite(inputs[port]).all():
                return f"{where}: input '{port}' is {inputs[port]}; every number must be finite"
        return (
            f"{where}, arms {', '.join(self.params.arms)}: the simulation is unstable. The likeliest cause is"
            " a bond whose wrench is too stiff for its step (shorten the step, or use impulse-linearised),"
            f" else the sub-step (timestep, now {self.params.timestep} ns)"
        )

    def _read_state(self) -> None:
        self._mujoco.mj_getState(self._model, self._data, self._state[: self._size], self._signature)
        at = self._size
        for keeper in self._keepers:
            state = keeper.state
            self._state[at : at + state.size] = state
            at += state.size

    def state_hash(self) -> int:
        """Return the hash of MuJoCo's integration state, setpoints and modes, holders, and energy books."""
        self._read_state()
        return state_hash(self._state)

    def save(self) -> bytes:
        """Return MuJoCo's integration state and the state of all parts.

        MuJoCo's is `mjSTATE_INTEGRATION`, with applied forces only where there are bonds.
        """
        self._read_state()
        return self._state.tobytes()

    def restore(self, state: bytes) -> None:
        """Return to a saved state, bit for bit. Raises StateError if the state does not fit this model."""
        if len(state) != self._state.nbytes:
            raise StateError(
                f"participant '{self.name}': a saved state of {len(state)} bytes, this model's has"
                f" {self._state.nbytes}; was it saved by another model?"
            )
        values = np.frombuffer(state)
        at = self._size
        for keeper in self._keepers:
            size = keeper.state.size
            keeper.state = values[at : at + size]
            at += size
        if self._exchange.engaged:
            self._servos.engage(self._exchange.engaged)
        self._mujoco.mj_setState(self._model, self._data, values[: self._size], self._signature)
        self._mujoco.mj_step1(self._model, self._data)
        self._readings.update()
        self._readings.refresh()
        self._holding.refresh()
        self._hands.refresh()
        if self._rigid is not None:
            self._rigid.refresh()
        self._coupling.refresh()

    def close(self) -> None:
        """Release model and data."""
        self._keepers.clear()
        self._outputs.clear()
