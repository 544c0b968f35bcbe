"""FMUs as engines: FMI 2.0 and 3.0, through FMPy.

Inputs and outputs of the FMU are ports, with names by `engines.fmu.variables.port_name`, in the FMU's units:
a length in mm fits an input in mm alone, unless `inputs` states a conversion. Scalars are
`std_msgs/msg/Float64`, FMI 3 arrays `std_msgs/msg/Float64MultiArray`, row by row. Integers, enumerations and
booleans (0, 1) are exchanged as doubles; an input without a valid number of its type ends the session.
Triggered clocks are event ports. Strings are `std_msgs/msg/String`, binaries `std_msgs/msg/UInt8MultiArray`;
arrays of these, and clocked ones, become no ports, with an entry in the log.
"""

from __future__ import annotations

from contextlib import closing
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from engines.fmu.bond_params import FmuBond
from engines.fmu.bonds import FmuSide
from engines.fmu.conversions import ConvertedInputs, InputConversion, convert_ports
from engines.fmu.coupling import Coupling
from engines.fmu.description import Description, describe
from engines.fmu.fmi2 import Fmi2Instance
from engines.fmu.fmi3 import Fmi3Instance, co_simulation_notes
from engines.fmu.instance import Instance
from engines.fmu.model_exchange import Fmi2ModelExchange, Fmi3ModelExchange, default_tolerance
from engines.fmu.repeated_reads import warn_of_changes
from engines.fmu.transfers import Stop
from engines.fmu.tunable import TunableParameters
from hub.participant import Inputs, Outputs, Params, Setup, Stepped, Value, state_hash
from hub.participant.state import split_state
from schemas.errors import ScenarioError, SessionError, StateError
from schemas.files import find_file
from schemas.ports import BondSide, Port
from schemas.quantity import Duration
from schemas.scenario import Name
from schemas.vectors import Vector

__all__ = ["FmuEngine", "FmuParams"]

_KINDS = {
    (2, True): Fmi2Instance,
    (3, True): Fmi3Instance,
    (2, False): Fmi2ModelExchange,
    (3, False): Fmi3ModelExchange,
}
"""Class of an instance by FMI's major version, and whether it is for co-simulation."""


class FmuParams(Params):
    """Parameters of an FMU."""

    open_to_pages: ClassVar[bool] = True

    native_code = ("path",)
    path: Path = Field(description="the .fmu file; a relative path starts at the scenario")
    start: dict[str, Any] = Field(
        default_factory=dict[str, Any],
        description=(
            "start values by FMU variable name: a number in the variable's unit, a text with a unit, a list"
            " for an array, true or false, or a text"
        ),
        examples=[{"mass": "50 g", "stages": 3}],
    )
    inputs: dict[str, InputConversion] = Field(
        default_factory=dict[str, InputConversion],
        description="conversions of connected inputs, by FMU variable name",
        examples=[{"force": {"unit": "mN", "factor": 0.001}}],
    )
    tolerance: float | None = Field(
        default=None,
        gt=0,
        allow_inf_nan=False,
        description="relative tolerance of the FMU's own solver, or of `solver`",
    )
    solver: Literal["cvode"] | None = Field(
        default=None,
        description=(
            "cvode: the FMU's model exchange, integrated by CVode of SUNDIALS; default: the FMU's own"
            " co-simulation, else cvode"
        ),
    )
    step: Duration | None = Field(
        default=None,
        gt=0,
        description="communication step of the FMU, a divisor of the period; default: the period",
    )
    bonds: dict[Name, FmuBond] = Field(
        default_factory=dict[str, FmuBond],
        description="power bonds by name: a force or a motion side, of variables of the FMU",
        examples=[{"shaft": {"side": "force", "force": "tau", "position": "phi", "velocity": "w"}}],
    )
    tunable: dict[str, tuple[Any, Any] | None] = Field(
        default_factory=dict[str, tuple[Any, Any] | None],
        description=(
            "tunable parameters of the FMU that may change while the session runs: least and greatest value,"
            " in the variable's unit or with one, or null for the FMU's own limits"
        ),
        examples=[{"gain": [0, 10], "damping": None}],
    )
    strict: bool = Field(
        default=True,
        description=(
            "false: load the FMU although its modelDescription.xml breaks a rule of FMI in a way that leaves"
            " something undefined, as FMPy does with validation off"
        ),
    )

    @field_validator("path")
    @classmethod
    def _from_scenario(cls, path: Path, info: ValidationInfo) -> Path:
        return find_file(path, info) if info.context else path  # nothing is opened before the ports are read


class FmuEngine(Stepped):
    """An FMU as a participant.

    Between communication points an FMU holds its inputs. For a connection with linear extrapolation, an FMI 2
    FMU with interpolation gets value and slope; any other FMU gets the mean of the input over each
    communication step, made as short as needed by `step`.

    `state_hash` covers the serialised state of the FMU if equal states have equal bytes. Many FMUs serialise
    addresses of memory as well (modelica/Reference-FMUs do, `getFMUState` in src/cosimulation.c), so a second
    instance is compared at the start. For states with differing bytes, and without serialisation, the hash
    covers inputs, outputs and the time.
    """

    params_model: ClassVar[type[Params]] = FmuParams
    params: FmuParams

    def __init__(self, name: str, params: FmuParams) -> None:
        super().__init__(name, params)
        self._instance: Instance | None = None
        self._hashes_state = False
        self._outputs: dict[str, Value] = {}
        self._time = np.zeros(1)
        self._sides: dict[str, BondSide] = {}
        """Bonds with the numbers known after `configure`, by name."""
        self._bonds: list[FmuSide] = []
        """Connected bonds."""

    @cached_property
    def _description(self) -> Description:
        try:
            params = self.params
            return describe(
                params.path,
                params.start,
                strict=params.strict,
                solver=params.solver,
                bonds=params.bonds,
                tunable=params.tunable,
            )
        except ScenarioError as error:
            error.path = ("participants", self.name, *(error.path or ("path",)))
            raise

    @cached_property
    def _converted(self) -> tuple[tuple[Port, ...], dict[str, InputConversion]]:
        ports = self._description.ports
        try:
            return convert_ports(ports, self.params.inputs)
        except ScenarioError as error:
            error.path = ("participants", self.name, *error.path)
            raise

    @property
    def ports(self) -> tuple[Port, ...]:
        """The FMU's inputs and outputs. Raises ScenarioError for a file without an FMU for this machine."""
        return self._converted[0]

    @property
    def integration(self) -> str:
        """Solver of model exchange, or what of FMI 3.0's co-simulation is used, for the plan."""
        description = self._description
        if description.co_simulation is not None:
            return co_simulation_notes(description.co_simulation) if description.major == 3 else ""
        tolerance = self.params.tolerance or default_tolerance(description.tolerance)
        return f"model exchange, integrated by CVode (SUNDIALS), relative tolerance {tolerance:g}"

    @property
    def bonds(self) -> tuple[BondSide, ...]:
        """The scenario's bonds; after `configure` with slopes and masses of connected ones."""
        return tuple(self._sides.get(one.side.name, one.side) for one in self._description.bonds)

    def configure(self, setup: Setup) -> Outputs:
        """Load the FMU, set start values and initialise to time 0."""
        step = self.params.step
        if step and setup.period_ns % step:
            problem = (
                f"the FMU's step of {step / 1e6:g} ms does not divide its period of"
                f" {setup.period_ns / 1e6:g} ms"
            )
            raise ScenarioError(problem, path=("participants", self.name, "step"))
        self.close()
        description = self._description
        self._instance = instance = self._start()
        self._outputs = {
            port: block.values[part] for block in instance.outputs for port, part in block.parts.items()
        }
        if instance.can_save and not description.interface.canBeInstantiatedOnlyOncePerProcess:
            with closing(self._start()) as twin:
                self._hashes_state = twin.serialise() == instance.serialise()
        coupling = Coupling(instance, description, step or setup.period_ns, self._start)
        self._bonds = []
        for bond in description.bonds:
            if plan := setup.bonds.get(bond.side.name):
                side, self._sides[bond.side.name] = coupling.couple(bond, plan)
                self._bonds.append(side)
                self._outputs |= side.initial()
        self._tunable = None
        if description.tunable:
            self._tunable = TunableParameters(instance, description.tunable, description.ports)
        self._has_clocks = bool(description.clocks)
        # what has ticked until now leaves with the first step: a message at time 0 has no reader
        self._outputs |= {
            port.name: () for clock in description.clocks if not clock.is_input for port in clock.ports
        }
        is_whole = step in (None, setup.period_ns)
        self._is_plain = is_whole and not (
            self._bonds
            or description.tunable
            or description.clocks
            or description.text_inputs
            or self._converted[1]
        )
        """Whether a step is one call of the FMU's, with the inputs as they are."""
        self._has_texts = bool(description.text_outputs)
        self._has_more = bool(self._bonds or instance.memory.size)
        outputs = self._read(0, instance, instance.get_outputs())
        warn_of_changes(instance, self.name)
        return outputs

    def _start(self) -> Instance:
        """Return an instance at time 0."""
        description = self._description
        instance = _KINDS[description.major, description.co_simulation is not None](description, self.name)
        try:
            instance.initialise(description.starts, self.params.tolerance)
        except BaseException:
            instance.close()
            raise
        return instance

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Advance the FMU from `t` to `t + h` (ns), or to the FMU's end of the simulation.

        Outputs are the values at `t + h`: after the step and, in FMI 3, after the events of this instant.
        Values read after fmi2DoStep belong to the end of the step (FMI 2.0.4 section 4.2.1), and in FMI 3
        with an event mode discrete outputs change in event mode only (FMI 3.0.1, Event Mode). FMPy's
        `simulate_fmu` records before and after an event: the second sample equals ours (docs/decisions/0036).
        After the FMU's end of the simulation the last outputs are held.
        """
        instance = self._instance or self._running()
        if self._is_plain:
            return self._read(t + h, instance, instance.take_step(t, h, inputs))
        if conversions := self._converted[1]:
            inputs = ConvertedInputs(inputs, conversions)
        for bond in self._bonds:
            bond.begin(inputs, h / 1e9)
        if self._tunable is not None and not instance.ended:
            instance.now_ns = t
            self._tunable.begin(inputs)
        sub = self.params.step or h
        for begin in range(0, h, sub):
            self._communicate(instance, inputs, t, begin, sub)
        for bond in self._bonds:
            self._outputs |= bond.result()
        if self._has_clocks:
            self._outputs |= instance.take_ticks()
        return self._read(t + h, instance, instance.get_outputs())

    def _communicate(self, instance: Instance, inputs: Inputs, t: int, begin: int, size: int) -> None:
        """Take a communication step of the FMU: `size` ns from `begin` ns into the step at `t`."""
        instance.now_ns = t + begin
        tau, dt = begin / 1e9, size / 1e9
        if not instance.ended:
            instance.set_inputs(inputs, tau, dt)
            for bond in self._bonds:
                bond.write(tau, dt)
        if not instance.ended:
            instance.advance(t + begin, size)
        for bond in self._bonds:
            bond.read(tau, dt)

    @property
    def ended(self) -> str:
        """Time and manner of the FMU's end of the simulation; empty: running."""
        return self._running().ended if self._instance else ""

    def state_hash(self) -> int:
        """Return the hash of the FMU's state, or else of inputs, outputs and time."""
        instance = self._instance or self._running()
        if self._hashes_state and not self._has_more:
            return state_hash(instance.serialise())
        bonds = [bond.state for bond in self._bonds]
        if self._hashes_state:
            return state_hash(instance.memory, *bonds, instance.serialise())
        values = (block.values for block in (*instance.inputs, *instance.outputs))
        texts = b"\0".join([*instance.text_inputs.values(), *instance.text_outputs.values()])
        return state_hash(self._time, *bonds, *values, texts)

    def save(self) -> bytes:
        """Return the FMU's state. Raises StateError for an FMU without this capability."""
        instance = self._running()
        self._check_can_save()
        return b"".join(part.tobytes() for part in self._kept()) + instance.serialise()

    def restore(self, state: bytes) -> None:
        """Return the FMU to a saved state. Raises StateError for an FMU without this capability."""
        instance = self._running()
        self._check_can_save()
        kept = self._kept()
        size = sum(part.nbytes for part in kept)
        if len(state) < size:
            raise StateError(
                f"participant '{self.name}': {len(state)} bytes are not a state of '{self.params.path.name}'"
            )
        instance.deserialise(state[size:])
        instance.memory[:], *bonds = split_state(self.name, kept, state[:size])
        for bond, part in zip(self._bonds, bonds, strict=True):
            bond.state = part
        instance.recall()
        if self._tunable is not None:
            self._tunable.read()

    def _kept(self) -> list[Vector]:
        """Return the state beside the FMU's own."""
        return [self._running().memory, *(bond.state for bond in self._bonds)]

    def close(self) -> None:
        """Terminate and unload the FMU and remove the extracted files."""
        instance, self._instance = self._instance, None
        if instance:
            instance.close()

    def _running(self) -> Instance:
        if self._instance is None:
            raise SessionError(f"participant '{self.name}' is not configured")
        return self._instance

    def _check_can_save(self) -> None:
        if self._running().can_save:
            return
        capabilities = self._description.interface
        for flag in ("canGetAndSetFMUstate", "canSerializeFMUstate"):
            if not getattr(capabilities, flag):
                raise StateError(
                    f"participant '{self.name}': '{self.params.path.name}' cannot save its state, its"
                    f" modelDescription.xml says {flag}=false"
                )
        raise StateError(
            f"participant '{self.name}': '{self.params.path.name}' cannot save its state, its library lacks"
            " functions for it"
        )

    def _read(self, t: int, instance: Instance, stop: Stop) -> Outputs:
        """Return the outputs at `t`; `stop`: the end of getting them."""
        self._time[0] = t
        if stop is not None:
            try:
                instance.refuse_output(*stop)
            except SessionError as error:
                raise SessionError(f"{error}, at {t / 1e9:.9g} s") from error
        if self._has_texts:
            self._outputs |= instance.text_outputs.get()
        return self._outputs
