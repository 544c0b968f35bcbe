"""Compiled calls beside their Python: the same values, hashes and errors."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import pytest

from engines.fmu import fmi3, instance, transfers
from engines.fmu.engine import FmuEngine
from schemas.errors import SessionError, StateError
from tests.engines.fmu.driving import BALL, MS, SPRING, Make, inputs_of
from tests.engines.fmus import build

pytestmark = [
    pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT),
    pytest.mark.skipif(transfers.compiled is None, reason="the package was installed without a compiler"),
]


def without_compiled(patch: pytest.MonkeyPatch) -> None:
    for module in (fmi3, instance, transfers):
        patch.setattr(module, "compiled", None)


def trajectory(engine: FmuEngine, given: list[dict[str, Any]]) -> list[tuple[int, dict[str, list[float]]]]:
    found: list[tuple[int, dict[str, list[float]]]] = []
    for i, values in enumerate(given):
        outputs = engine.step(i * MS, MS, inputs_of(engine, rates=values.pop("rates", None), **values))
        found.append(
            (
                engine.state_hash(),
                {name: np.array(value).tolist() for name, value in outputs.items() if name != "image"},
            )
        )
        if i == len(given) // 2:
            with contextlib.suppress(StateError):
                engine.restore(engine.save())
    return found


def spring_inputs() -> list[dict[str, Any]]:
    rng = np.random.default_rng(1)
    return [
        {"F": rng.normal(), "stage": 1 + i // 7 % 2, "locked": i // 20 % 2}
        | ({"rates": {"F": rng.normal()}} if i % 5 == 3 else {})
        for i in range(40)
    ]


def ball_inputs() -> list[dict[str, Any]]:
    rng = np.random.default_rng(2)
    return [{"u": rng.normal(size=3), "frozen": i // 15 % 2} for i in range(40)]


@pytest.mark.parametrize(
    ("model", "given", "edits"),
    [
        (SPRING, spring_inputs, None),
        (SPRING, spring_inputs, {' canInterpolateInputs="true"': ""}),
        (SPRING, spring_inputs, {' canSerializeFMUstate="true"': ""}),
        (BALL, ball_inputs, None),
        (BALL, ball_inputs, {' hasEventMode="true"': ""}),
    ],
    ids=["FMI 2", "held inputs", "no state", "FMI 3", "no events"],
)
def test_the_same_in_every_bit(
    make: Make, monkeypatch: pytest.MonkeyPatch, model: str, given: Any, edits: dict[str, str] | None
) -> None:
    compiled = trajectory(make(model, edits=edits), given())
    without_compiled(monkeypatch)
    assert trajectory(make(model, edits=edits), given()) == compiled


@pytest.mark.parametrize(
    ("model", "values", "expected"),
    [
        (SPRING, {"stage": 1.5}, "'stage' takes whole numbers"),
        (SPRING, {"stage": 1e12}, "'stage' takes whole numbers"),
        (SPRING, {"locked": 2.0}, "'locked' takes whole numbers"),
        (BALL, {"frozen": 2.0}, "'frozen' takes whole numbers"),
    ],
)
def test_inputs_that_do_not_fit(make: Make, model: str, values: dict[str, float], expected: str) -> None:
    engine = make(model)
    with pytest.raises(SessionError, match=expected):
        trajectory(engine, [{}, values])


def test_an_input_of_another_size_is_left_to_python(make: Make) -> None:
    """A single number for an array sets all elements, as in NumPy."""
    one, three = make(BALL), make(BALL)
    assert trajectory(one, [{"u": 0.5}]) == trajectory(three, [{"u": [0.5] * 3}])


def test_buffers_that_do_not_fit_are_refused() -> None:
    assert transfers.compiled is not None
    numbers, short = np.zeros(3), np.zeros(2)
    for raw, values, parts in (
        (numbers, short, (("a", 3),)),
        (numbers, numbers, (("a", 2),)),
        (numbers[::2], short, (("a", 2),)),
        (numbers, numbers, (("a", "b"),)),
    ):
        block: Any = (1, False, b"\0" * 4, raw, values, False, parts)
        with pytest.raises((TypeError, ValueError)):
            transfers.compiled.Blocks(1, (block,))
