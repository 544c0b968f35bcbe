"""The conformance check of engines and controllers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from hub.participant import BondPlan, Stepped, Value
from hub.testing.contract import check_declarations, require
from hub.testing.rig import Rig
from schemas.codec import encode
from schemas.errors import StateError
from schemas.message import Message

__all__ = ["check_engine"]

_IMPULSE = BondPlan(prediction="velocity", mean=True)
_STEPS = 10


def check_engine(
    make: Callable[[], Stepped],
    *,
    period_ns: int = 1_000_000,
    inputs: Mapping[str, ArrayLike | Message | tuple[Message, ...]] | None = None,
    bonds: Mapping[str, BondPlan] | None = None,
    counts_steps: bool = False,
    directory: Path | None = None,
) -> None:
    """Check that the participant `make` returns keeps the contract of an engine or a controller.

        trocar.check_engine(lambda: Pendulum("pendulum", PendulumParams()), inputs={"torque": [0.1]})

    Args:
        make: Returns a new instance of the same participant, not configured, at each call.
        period_ns: The step of the check, in nanoseconds; twice this step must work as well.
        inputs: Value of each input with another value than the start value; events arrive at every step. The
            position of a bond's force side moves with the velocity, so a velocity into a contact tests the
            work; on a motion side, a force without torque does.
        bonds: The bonds to connect, by name; default: all, coupled by `impulse`.
        counts_steps: The result depends on the number of steps and not on their length.
        directory: Where relative paths start.

    Raises:
        AssertionError: The contract is broken; the message quotes the rule.
    """
    plans = bonds if bonds is not None else {side.name: _IMPULSE for side in make().bonds}
    place = directory or Path.cwd()
    with make() as participant:
        check_declarations(participant)
        participant.close()  # before `configure`

    def create_rig(period: int = period_ns) -> Rig:
        return Rig(make(), period, inputs or {}, plans, place)

    with create_rig() as one, create_rig() as other:
        _check_run(one, other)
        _check_restore(one)
    if not counts_steps:
        with create_rig() as one, create_rig(2 * period_ns) as other:
            _check_step_length(one, other)


def _check_run(one: Rig, other: Rig) -> None:
    """Two instances with equal inputs do the same."""
    require(
        one.checked_hash == other.checked_hash, "two instances have the same state hash after configure()"
    )
    for step in range(_STEPS):
        require(
            one.step() == other.step(),
            f"equal inputs give equal state hashes, but those of two instances differ after step {step}",
        )
        for name, value in one.outputs.items():
            require(
                _equal_values(value, other.outputs[name]),
                f"equal inputs give equal outputs, but '{name}' of two instances differs after step {step}",
            )


def _equal_values(one: Value, other: Value) -> bool:
    if isinstance(one, np.ndarray):
        return np.array_equal(one, cast("Any", other))
    return _encode_all(one) == _encode_all(cast("Message | tuple[Message, ...]", other))


def _encode_all(value: Message | tuple[Message, ...]) -> list[bytes]:
    return [encode(message) for message in (value if isinstance(value, tuple) else (value,))]


def _check_restore(rig: Rig) -> None:
    """After restore(), the steps after save() give the same hashes again."""
    try:
        state = rig.participant.save()
    except StateError:
        return
    require(
        isinstance(cast(Any, state), bytes), f"save() returns bytes, but it returned {type(state).__name__}"
    )
    saved, surroundings = rig.checked_hash, rig.save_surroundings()
    first = [rig.step() for _ in range(_STEPS)]
    rig.participant.restore(state)
    require(rig.checked_hash == saved, "restore() brings back the state, but the state hash is another one")
    rig.restore_surroundings(surroundings)
    again = [rig.step() for _ in range(_STEPS)]
    require(first == again, "what follows restore() is, bit for bit, what followed save()")


def _check_step_length(one: Rig, other: Rig) -> None:
    """A state that moves by itself differs after a step of twice the length."""
    first, second = one.step(), one.step()
    if second != first:
        require(
            other.step() != first,
            "step() advances by `h`, but twice the step gives the same state (or pass counts_steps=True)",
        )
