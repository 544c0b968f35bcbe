"""The test FMUs by name, and how they are driven without a session."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from engines.fmu.engine import FmuEngine
from hub.participant import Inputs
from schemas.ports import Port

MS = 10**6
SPRING, BALL, STAIR = "mass_spring_damper", "bouncing_ball", "stair"
Make = Callable[..., FmuEngine]


def inputs_of(engine: FmuEngine, rates: dict[str, float] | None = None, **values: Any) -> Inputs:
    given = {p.name: np.array(p.start, np.float64) for p in engine.ports if p.causality == "input"}
    inputs = Inputs(
        given | {name: np.atleast_1d(np.asarray(value, np.float64)) for name, value in values.items()}
    )
    inputs._rates = {name: np.array([rate]) for name, rate in (rates or {}).items()}
    return inputs


def run(
    engine: FmuEngine, steps: int, period: int = MS, start: int = 0, inputs: Inputs | None = None
) -> dict[str, float]:
    """Step the engine; return the first element of every output of numbers at the end."""
    outputs: Any = {}
    inputs = inputs or inputs_of(engine)
    for i in range(start, start + steps):
        outputs = engine.step(i * period, period, inputs)
    return {name: float(value[0]) for name, value in outputs.items() if isinstance(value, np.ndarray)}


def ports(engine: FmuEngine) -> dict[str, Port]:
    return {port.name: port for port in engine.ports}
