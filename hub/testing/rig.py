"""A stepped participant, driven by hand and checked at every step."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from hub.participant import BondPlan, Inputs, Outputs, Setup, Stepped, Value
from hub.testing.contract import check_message, require
from hub.testing.driver import start_value
from hub.testing.rig_bonds import RigBonds
from hub.transport.port_codec import PortCodec
from schemas.errors import MessageError
from schemas.message import Message
from schemas.ports import BondSide, Port, bond_ports
from schemas.vectors import Vector

__all__ = ["Rig"]


@dataclass(frozen=True)
class _Surroundings:
    values: dict[str, Any]
    outputs: dict[str, Value]
    work: dict[str, float]
    time_ns: int


class Rig:
    """A configured participant with inputs; every method raises AssertionError if a rule is broken."""

    def __init__(
        self,
        participant: Stepped,
        period_ns: int,
        inputs: Mapping[str, ArrayLike | Message | tuple[Message, ...]],
        plans: Mapping[str, BondPlan],
        directory: Path,
    ) -> None:
        self.participant = participant
        self.time_ns = 0
        self._period_ns = period_ns
        declared, sides = participant.ports, {side.name: side for side in participant.bonds}
        missing = sorted(plans.keys() - sides.keys())
        require(
            not missing,
            f"every bond to be connected is declared, but there is no {missing} among {sorted(sides)}",
        )
        self._ports = [*declared, *(port for name in plans for port in bond_ports(sides[name]))]
        self._codecs = {port.name: PortCodec(port) for port in self._ports}
        self._bonds = RigBonds(sides, plans)
        self._works = sorted(f"{name}/work" for name in plans)
        names = {port.name for port in self._ports if port.causality == "input"}
        unknown = sorted(inputs.keys() - names)
        require(not unknown, f"there are no inputs {unknown}; there are {sorted(names)}")
        self._values = {
            port.name: self._start(port, inputs)
            for port in self._ports
            if port.name in names and port.variability == "signal"
        }
        self._events = {
            name: cast("tuple[Message, ...]", inputs[name]) for name in inputs if name not in self._values
        }
        setup = Setup(period_ns, directory, plans, frozenset(inputs))
        self.outputs = self._check_outputs(participant.configure(setup), "configure()")
        require(declared == participant.ports, "configure() does not change the ports")
        require(
            _shapes(participant.bonds) == _shapes(sides.values()),
            "configure() does not change name, side, dof or points of a bond",
        )

    def __enter__(self) -> Rig:
        return self

    def __exit__(self, *_: object) -> None:
        self.participant.close()
        self.participant.close()  # may be called twice

    @property
    def checked_hash(self) -> int:
        """The state hash, read twice: both must be the same."""
        value = self.participant.state_hash()
        require(
            isinstance(cast(Any, value), int) and 0 <= value < 2**64,
            f"state_hash() is an unsigned number of 64 bits, but it is {value!r}",
        )
        same = value == self.participant.state_hash()
        require(same, "state_hash() does not change while nothing is stepped")
        return value

    def step(self) -> int:
        """Step once; return the state hash."""
        before, positions = self.checked_hash, self._bonds.positions(self.outputs)
        given = {
            name: cast("Vector", value).copy()
            for name, value in self._values.items()
            if isinstance(value, np.ndarray)
        }
        inputs = Inputs(dict(self._values), events=dict(self._events))
        outputs = self.participant.step(self.time_ns, self._period_ns, inputs)
        self.time_ns += self._period_ns
        for name, value in given.items():
            same = np.array_equal(value, cast("Vector", self._values[name]))
            require(same, f"step() does not write to its inputs, but it changed '{name}'")
        new = self._check_outputs(outputs, "step()")
        changed = [
            name
            for name, value in new.items()
            if isinstance(value, np.ndarray)
            and not np.array_equal(value, cast("Any", self.outputs.get(name)))
        ]
        after = self.checked_hash
        require(
            not changed or after != before,
            f"state_hash() changes with the state, but it did not when {changed} changed",
        )
        self.outputs = {**self.outputs, **new}
        seconds = self._period_ns * 1e-9
        self._bonds.check_work(self.outputs, self._values, positions, seconds)
        self._bonds.move(self._values, seconds)
        return after

    def save_surroundings(self) -> _Surroundings:
        """Return the state of the rig, without the participant, between two steps."""
        return _Surroundings(dict(self._values), self.outputs, dict(self._bonds.work), self.time_ns)

    def restore_surroundings(self, saved: _Surroundings) -> None:
        """Return to the state from `save_surroundings`."""
        self._values, self.outputs, self.time_ns = dict(saved.values), saved.outputs, saved.time_ns
        self._bonds.work = dict(saved.work)

    def _start(self, port: Port, inputs: Mapping[str, Any]) -> Any:
        codec = self._codecs[port.name].vector
        if port.name in inputs:
            value = inputs[port.name]
            return value if codec is None else codec.check_vector(np.atleast_1d(np.array(value, np.float64)))
        return start_value(port)

    def _check_outputs(self, outputs: Outputs, where: str) -> dict[str, Value]:
        """Return copies of all outputs due now, each checked."""
        expected = [port for port in self._ports if port.causality == "output"]
        extra = sorted(outputs.keys() - {port.name for port in expected} - set(self._works))
        require(not extra, f"{where} returns declared outputs only, but also {extra}")
        found: dict[str, Value] = {}
        for port in expected:
            if self.time_ns == 0 or not port.period_ns or not self.time_ns % port.period_ns:
                require(port.name in outputs, f"{where} returns every output, but '{port.name}' is missing")
                found[port.name] = self._value(port, outputs[port.name], where)
        for name in self._works if where == "step()" else ():
            found[name] = _work(name, outputs.get(name))
        return found

    def _value(self, port: Port, value: Any, where: str) -> Value:
        codec = self._codecs[port.name]
        if codec.vector is not None:
            array = isinstance(value, np.ndarray)
            require(array, f"{where} returns '{port.name}' as an array, but it is {value!r}")
            try:
                return codec.vector.check_vector(value).copy()
            except MessageError as error:
                raise AssertionError(f"{where} returns what its ports declare: {error}") from error
        if codec.is_event:
            batch = isinstance(value, tuple)
            require(batch, f"{where} returns '{port.name}' as a tuple of messages, but it is {value!r}")
        for message in codec.batch(value) if codec.is_event else (value,):
            check_message(port, message, where)
        return value


def _work(name: str, work: Value | None) -> Vector:
    rule = f"step() returns the work of a bond as one finite float64 under '{name}', but it is {work!r}"
    if not isinstance(work, np.ndarray):
        raise AssertionError(f"the contract of hub.participant: {rule}")
    require(work.shape == (1,) and work.dtype == np.float64 and bool(np.isfinite(work).all()), rule)
    return work.copy()


def _shapes(sides: Iterable[BondSide]) -> set[tuple[str, str, int, int]]:
    return {(side.name, side.side, side.dof, side.points) for side in sides}
