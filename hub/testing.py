"""Conformance checks for participants, and a way to run them without files and processes.

Whoever writes a participant calls `check_engine` or `check_device` in a test of its own. Every failure is an
AssertionError that says what the contract of `hub.participant` asks for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from time import monotonic_ns, sleep
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike
from pydantic import ValidationError

from hub.observation.summary import Summary
from hub.participant import BondPlan, Device, Inputs, Outputs, Sample, Setup, Stepped, Value
from hub.planning.wiring import make_plan
from hub.session.launch import in_one_host
from hub.session.session import Session
from hub.transport.endpoints import free_endpoint
from hub.transport.port_codec import PortCodec
from schemas.codec import encode
from schemas.errors import MessageError, StateError, TrocarError
from schemas.message import Message
from schemas.ports import BondSide, Port, bond_ports
from schemas.ros import Header
from schemas.scenario import Scenario
from schemas.vectors import Vector

__all__ = ["check_device", "check_engine", "run_in_process"]

_IMPULSE = BondPlan(prediction="velocity", mean=True)
_STEPS = 10
_READS, _READ_NS = 20, 10_000_000
_WORK_TOLERANCE = 0.01
"""Share by which work and force times way may differ: an engine may count its own way at its sub-steps."""
_LEAST_WORK_J = 1e-12


def run_in_process(
    scenario: Mapping[str, Any],
    participants: Mapping[str, Stepped | Device],
    *,
    directory: Path | None = None,
) -> Summary:
    """Run a scenario with these instances in this process, unrecorded, and return its summary.

        tree = {"name": "swing", "step": "1 ms", "duration": "1 s"}
        summary = trocar.run_in_process(tree, {"pendulum": Pendulum("pendulum", PendulumParams())})

    Args:
        scenario: The tree of a scenario file. A participant may be left out of it, and so may its kind.
        participants: The instances, by name.
        directory: Where relative paths start; by default the working directory.

    Raises:
        ScenarioError: The scenario is not valid.
        SessionError: The session failed.
    """
    given: Mapping[str, Any] = scenario.get("participants", {})
    specs = {name: {"kind": type(p).__name__, **given.get(name, {})} for name, p in participants.items()}
    checked = in_one_host(Scenario.model_validate({**scenario, "participants": specs}))
    roles = {name: "device" if isinstance(p, Device) else "engine" for name, p in participants.items()}
    plan = make_plan(checked, participants, roles)
    return Session(
        checked, plan, participants, directory or Path.cwd(), endpoint=free_endpoint(range(1))
    ).run()


def check_engine(
    make: Callable[[], Stepped],
    *,
    period_ns: int = 1_000_000,
    inputs: Mapping[str, ArrayLike | Message | tuple[Message, ...]] | None = None,
    bonds: Mapping[str, BondPlan] | None = None,
    counts_steps: bool = False,
    directory: Path | None = None,
) -> None:
    """Check that what `make` returns keeps the contract of an engine or a controller.

        trocar.check_engine(lambda: Pendulum("pendulum", PendulumParams()), inputs={"torque": [0.1]})

    Args:
        make: Returns a new instance of the same participant, not configured, each time it is called.
        period_ns: The step to try it with, in nanoseconds; it must work at twice this step as well.
        inputs: Value of each input that is not to be at its start value; events arrive at every step. The
            position of a bond's force side moves with its velocity, so a velocity into a contact tests the
            work; on a motion side a force without torque does.
        bonds: The bonds to connect, by name; default: all, coupled by `impulse`.
        counts_steps: What it does depends on the number of its steps and not on how long they are.
        directory: Where relative paths start.

    Raises:
        AssertionError: The contract is broken; the message says where.
    """
    plans = bonds if bonds is not None else {side.name: _IMPULSE for side in make().bonds}
    place = directory or Path.cwd()
    with make() as participant:
        _check_declarations(participant)
        participant.close()  # before `configure`

    def rig(period: int = period_ns) -> _Rig:
        return _Rig(make(), period, inputs or {}, plans, place)

    with rig() as one, rig() as other:
        _check_run(one, other)
        _check_restore(one)
    if not counts_steps:
        with rig() as one, rig(2 * period_ns) as other:
            _check_step_length(one, other)


def _check_declarations(participant: Stepped | Device) -> None:
    kind = type(participant)
    ports = participant.ports
    names = [port.name for port in ports]
    _require(len(set(names)) == len(names), f"port names are unique, but these are {names}")
    _require(ports == participant.ports, "ports are the same each time they are read")
    for port in ports:
        PortCodec(port)  # a type nobody knows is a MessageError that says so
        if port.start is not None:
            codec = PortCodec(port).vector
            fits = codec is not None and len(port.start) == codec.size
            _require(
                fits,
                f"the start value of input '{port.name}' has one number for each of the port, but it is"
                f" {port.start}",
            )
    try:
        again = kind.params_model.model_validate_json(participant.params.model_dump_json())
    except ValidationError as error:
        raise AssertionError(
            f"the contract of hub.participant: parameters survive JSON, but {participant.params!r} do not:"
            f" {error}"
        ) from error
    _require(
        again == participant.params, f"parameters survive JSON, but {participant.params!r} became {again!r}"
    )


class _Rig:
    """One stepped participant with its inputs, driven by hand and checked at every step."""

    def __init__(
        self,
        participant: Stepped,
        period_ns: int,
        inputs: Mapping[str, ArrayLike | Message | tuple[Message, ...]],
        plans: Mapping[str, BondPlan],
        place: Path,
    ) -> None:
        self.participant = participant
        self.time_ns = 0
        self._period_ns = period_ns
        self._plans = plans
        self._declared = participant.ports
        self._sides = {side.name: side for side in participant.bonds}
        missing = sorted(plans.keys() - self._sides.keys())
        _require(
            not missing,
            f"every bond to be connected is declared, but there is no {missing} among {sorted(self._sides)}",
        )
        self._ports = [*self._declared, *(port for name in plans for port in bond_ports(self._sides[name]))]
        self._codecs = {port.name: PortCodec(port) for port in self._ports}
        takes = {port.name for port in self._ports if port.causality == "input"}
        _require(
            inputs.keys() <= takes,
            f"there are no inputs {sorted(inputs.keys() - takes)}; there are {sorted(takes)}",
        )
        self._values = {
            port.name: self._start(port, inputs)
            for port in self._ports
            if port.name in takes and port.variability == "signal"
        }
        self._events = {
            name: cast("tuple[Message, ...]", inputs[name]) for name in inputs if name not in self._values
        }
        self._work = dict.fromkeys(plans, 0.0)
        self.outputs = self._checked(participant.configure(Setup(period_ns, place, plans)), "configure()")
        _require(self._declared == participant.ports, "configure() does not change the ports")
        sides = {side.name: (side.side, side.dof, side.points) for side in participant.bonds}
        declared = {name: (s.side, s.dof, s.points) for name, s in self._sides.items()}
        _require(sides == declared, "configure() does not change name, side, dof or points of a bond")

    def __enter__(self) -> _Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self.participant.close()
        self.participant.close()  # may be called twice

    @property
    def hash(self) -> int:
        """The state hash, which must be the same however often it is asked for."""
        value = self.participant.state_hash()
        _require(
            isinstance(cast(Any, value), int) and 0 <= value < 2**64,
            f"state_hash() is an unsigned number of 64 bits, but it is {value!r}",
        )
        _require(
            value == self.participant.state_hash(), "state_hash() does not change while nothing is stepped"
        )
        return value

    def step(self) -> int:
        """Step once; return the state hash."""
        before, motion = self.hash, self._motion()
        inputs = Inputs(dict(self._values))
        inputs._events.update(self._events)  # pyright: ignore[reportPrivateUsage]  # as the host does
        given = {
            name: cast("Vector", value).copy()
            for name, value in self._values.items()
            if isinstance(value, np.ndarray)
        }
        outputs = self.participant.step(self.time_ns, self._period_ns, inputs)
        self.time_ns += self._period_ns
        for name, value in given.items():
            _require(
                np.array_equal(value, cast("Vector", self._values[name])),
                f"step() does not write to its inputs, but it changed '{name}'",
            )
        outputs = self._checked(outputs, "step()")
        changed = [
            name
            for name, value in outputs.items()
            if isinstance(value, np.ndarray)
            and not np.array_equal(value, cast("Any", self.outputs.get(name)))
        ]
        hashed = self.hash
        _require(
            not changed or hashed != before,
            f"state_hash() changes with the state, but it did not when {changed} changed",
        )
        self.outputs = {**self.outputs, **outputs}
        self._check_work(motion)
        self._move()
        return hashed

    def remembered(self) -> tuple[dict[str, Any], dict[str, Value], dict[str, float], int]:
        """Return what this knows of the participant's past, for `go_back`."""
        return dict(self._values), self.outputs, dict(self._work), self.time_ns

    def go_back(self, before: tuple[dict[str, Any], dict[str, Value], dict[str, float], int]) -> None:
        """Return to what `remembered` returned."""
        values, self.outputs, work, self.time_ns = before
        self._values, self._work = dict(values), dict(work)

    def _start(self, port: Port, inputs: Mapping[str, Any]) -> Any:
        codec = self._codecs[port.name].vector
        if port.name in inputs:
            value = inputs[port.name]
            return value if codec is None else codec.checked(np.atleast_1d(np.array(value, np.float64)))
        if codec is None:
            return None
        return codec.neutral.copy() if port.start is None else np.array(port.start, np.float64)

    def _checked(self, outputs: Outputs, where: str) -> dict[str, Value]:
        """Return copies of all outputs that are due now, after a look at each."""
        expected = [port for port in self._ports if port.causality == "output"]
        works = {f"{name}/work" for name in self._plans}
        extra = sorted(outputs.keys() - {port.name for port in expected} - works)
        _require(not extra, f"{where} returns declared outputs only, but also {extra}")
        found: dict[str, Value] = {}
        for port in expected:
            if self.time_ns == 0 or not port.period_ns or not self.time_ns % port.period_ns:
                _require(port.name in outputs, f"{where} returns every output, but '{port.name}' is missing")
                found[port.name] = self._value(port, outputs[port.name], where)
        for name in sorted(works) if where == "step()" else ():
            work = outputs.get(name)
            fits = (
                isinstance(work, np.ndarray)
                and work.shape == (1,)
                and work.dtype == np.float64
                and bool(np.isfinite(work).all())
            )
            _require(
                fits,
                f"step() returns the work of a bond as one finite float64 under '{name}', but it is {work!r}",
            )
            found[name] = cast("Vector", work).copy()
        return found

    def _value(self, port: Port, value: Any, where: str) -> Value:
        codec = self._codecs[port.name]
        if codec.vector is not None:
            _require(
                isinstance(value, np.ndarray),
                f"{where} returns '{port.name}' as an array, but it is {value!r}",
            )
            try:
                return codec.vector.checked(value).copy()
            except MessageError as error:
                raise AssertionError(f"{where} returns what its ports declare: {error}") from error
        if codec.is_event:
            _require(
                isinstance(value, tuple),
                f"{where} returns '{port.name}' as a tuple of messages, but it is {value!r}",
            )
        for message in codec.batch(value) if codec.is_event else (value,):
            _check_message(port, message, where)
        return value

    def _motion(self) -> dict[str, Vector]:
        """The position of every motion side, shape (size,) or (7,)."""
        return {
            name: cast("Vector", self.outputs[f"{name}/{_word(side, 0)}"])
            for name, side in self._planned("motion")
        }

    def _move(self) -> None:
        """Let the position of every force side go on with its velocity."""
        for name, side in self._planned("force"):
            position, linear = f"{name}/{_word(side, 0)}", side.linear
            moved = cast("Vector", self._values[position]).copy()
            moved[:linear] += (
                cast("Vector", self._values[f"{name}/{_word(side, 1)}"])[:linear] * self._period_ns * 1e-9
            )
            self._values[position] = moved

    def _check_work(self, before: Mapping[str, Vector]) -> None:
        for name, plan in self._plans.items():
            side = self._sides[name]
            velocity, force = f"{name}/{_word(side, 1)}", f"{name}/{_word(side, 2)}"
            total = float(cast("Vector", self.outputs[f"{name}/work"])[0])
            done, self._work[name] = total - self._work[name], total
            if side.side == "force" and plan.mean and plan.prediction == "velocity":
                power = float(cast("Vector", self.outputs[force]) @ cast("Vector", self._values[velocity]))
                _check_equal_work(
                    name,
                    done,
                    -power * self._period_ns * 1e-9,
                    "minus its force times the way of the other side",
                )
            elif side.side == "motion" and plan.correction is None:
                linear = side.linear
                way = (
                    cast("Vector", self.outputs[f"{name}/{_word(side, 0)}"])[:linear] - before[name][:linear]
                )
                pushed = cast("Vector", self._values[force])
                if not pushed[linear:].any():
                    _check_equal_work(
                        name, done, -float(pushed[:linear] @ way), "minus the force on it times its way"
                    )

    def _planned(self, word: str) -> Iterator[tuple[str, BondSide]]:
        return ((name, self._sides[name]) for name in self._plans if self._sides[name].side == word)


def _word(side: BondSide, index: int) -> str:
    return bond_ports(side)[index].name.removeprefix(f"{side.name}/")


def _check_equal_work(name: str, done: float, expected: float, words: str) -> None:
    close = abs(done - expected) <= _WORK_TOLERANCE * abs(expected) + _LEAST_WORK_J
    _require(
        close, f"the work of bond '{name}' in a step is {words}: {expected:.6g} J, but it is {done:.6g} J"
    )


def _check_run(one: _Rig, other: _Rig) -> None:
    _require(one.hash == other.hash, "two instances have the same state hash after configure()")
    for step in range(_STEPS):
        _require(
            one.step() == other.step(),
            f"equal inputs give equal state hashes, but those of two instances differ after step {step}",
        )
        for name, value in one.outputs.items():
            same = (
                np.array_equal(value, cast("Any", other.outputs[name]))
                if isinstance(value, np.ndarray)
                else _bytes(value) == _bytes(other.outputs[name])
            )
            _require(
                same,
                f"equal inputs give equal outputs, but '{name}' of two instances differs after step {step}",
            )


def _bytes(value: Any) -> list[bytes]:
    return [
        encode(message)
        for message in (
            cast("tuple[Message, ...]", value) if isinstance(value, tuple) else (cast("Message", value),)
        )
    ]


def _check_restore(rig: _Rig) -> None:
    """Save, go on, come back and go on again."""
    try:
        state = rig.participant.save()
    except StateError:
        return
    saved, before = rig.hash, rig.remembered()
    _require(
        isinstance(cast(Any, state), bytes), f"save() returns bytes, but it returned {type(state).__name__}"
    )
    first = [rig.step() for _ in range(_STEPS)]
    rig.participant.restore(state)
    _require(rig.hash == saved, "restore() brings back the state, but the state hash is another one")
    rig.go_back(before)
    again = [rig.step() for _ in range(_STEPS)]
    _require(first == again, "what follows restore() is, bit for bit, what followed save()")


def _check_step_length(one: _Rig, other: _Rig) -> None:
    """A state that moves by itself must be another one after a step of twice the length."""
    first, second = one.step(), one.step()
    if second != first:
        _require(
            other.step() != first,
            "step() advances by `h`, but twice the step gives the same state (or give counts_steps=True)",
        )


def check_device(
    make: Callable[[], Device], *, inputs: Mapping[str, Value] | None = None, directory: Path | None = None
) -> None:
    """Check that what `make` returns keeps the contract of a device.

        trocar.check_device(lambda: Wave("wave", WaveParams(clock="wall")))

    A device in wall time is read for a fifth of a second, one in simulated time for as much of that.

    Args:
        make: Returns a new instance of the same device, not opened, each time it is called.
        inputs: Values to write to its input ports before each read; by default the start or neutral value.
        directory: Where relative paths start.

    Raises:
        AssertionError: The contract is broken; the message says where.
    """
    with make() as device:
        _check_declarations(device)
        wall = _in_wall_time(device.ports)
        device.close()  # before `open`
    said = _said(make, inputs or {}, directory or Path.cwd())
    if not wall:
        again = _said(make, inputs or {}, directory or Path.cwd())
        _require(
            said == again,
            "a device that follows the clock says the same when it is told the same, but two instances"
            " differ",
        )


def _said(
    make: Callable[[], Device], inputs: Mapping[str, Value], directory: Path
) -> list[tuple[str, bytes]]:
    """Return all that a device says, as port and bytes, after a look at each sample."""
    with make() as device:
        declared = device.ports
        codecs = {port.name: PortCodec(port) for port in declared}
        device.open(directory)
        _require(declared == device.ports, "open() does not change the ports")
        stamps: dict[str, int] = {}
        said: list[tuple[str, bytes]] = []
        for time_ns in _read_times(declared):
            for port in declared:
                if port.causality == "input":
                    _write(device, codecs[port.name], inputs)
            for sample in device.read(time_ns):
                _check_sample(sample, codecs, stamps)
                said.append((sample.port, encode(sample.message)))
        device.close()
        device.close()  # and a third time at the end of `with`
    return said


def _in_wall_time(ports: tuple[Port, ...]) -> bool:
    return any(port.clock == "wall" for port in ports)


def _write(device: Device, codec: PortCodec, inputs: Mapping[str, Value]) -> None:
    port = codec.port
    neutral = (
        codec.vector.neutral
        if codec.vector is not None and port.start is None
        else np.array(port.start or (), np.float64)
    )
    if port.name in inputs or codec.vector is not None:
        try:
            device.write(port.name, inputs.get(port.name, neutral))
        except TrocarError as error:
            raise AssertionError(
                f"write() takes what its ports declare, but refused '{port.name}': {error}"
            ) from error


def _read_times(ports: tuple[Port, ...]) -> Iterator[int]:
    wall = _in_wall_time(ports)
    start_ns = monotonic_ns()
    for i in range(_READS):
        if wall:
            sleep(_READ_NS / 1e9)
        yield monotonic_ns() - start_ns if wall else i * _READ_NS


def _check_sample(sample: Sample, codecs: Mapping[str, PortCodec], stamps: dict[str, int]) -> None:
    codec = codecs.get(sample.port)
    outputs = sorted(name for name, known in codecs.items() if known.port.causality == "output")
    if codec is None or codec.port.causality != "output":
        raise AssertionError(
            f"read() returns samples of declared outputs, {outputs}, but one is of '{sample.port}'"
        )
    _check_message(codec.port, sample.message, "read()")
    header = getattr(sample.message, "header", None)
    if isinstance(header, Header):
        last = stamps.get(sample.port, header.stamp.ns)
        _require(
            header.stamp.ns >= last,
            f"the stamps of '{sample.port}' do not go back, but {header.stamp.ns} ns comes after {last} ns",
        )
        stamps[sample.port] = header.stamp.ns


def _check_message(port: Port, message: Any, where: str) -> None:
    _require(isinstance(message, Message), f"{where} gives messages on '{port.name}', but also {message!r}")
    _require(
        message.ros_type == port.type,
        f"{where} gives {port.type} on '{port.name}', but also {message.ros_type}",
    )
    try:
        PortCodec(port).accept(encode(message))
    except MessageError as error:
        raise AssertionError(f"{where} gives what its ports declare: {error}") from error


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise AssertionError(f"the contract of hub.participant: {message}")
