"""What the MuJoCo engine costs beside bare `mj_step`: the whole patient cart with six objects, at 1 kHz.

    python bench/cart.py --json

Both run in the same process in turns, on models of the same scene; medians of the rounds. `core_beyond` is the share of one core at
1 kHz that the engine takes beyond bare `mj_step`, state hash included; `real_time_factor` is that of the engine with its hash.
Times move with the machine's load, `ratio` hardly.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.inputs import Inputs
from hub.participant import Setup

STEP_NS = 1_000_000
ROUNDS = 20
STEPS_A_ROUND = 200
SCENE = {
    "mounting": "cart",
    "timestep": "1 ms",
    "looks": False,
    "arms": {"PSM1": {"instrument": "400006"}, "PSM2": {"instrument": "400006"}, "PSM3": {"instrument": "400049"}, "ECM": {}},
    "table": {"position": [0.054, 1.11, 0.75]},
    "objects": {
        **{f"block{i}": {"kind": "block", "position": [0.02 * i, 1.11, 0.7603]} for i in range(4)},
        "ring": {"kind": "ring", "position": [0.05, 1.16, 0.751]},
        "needle": {"kind": "needle", "position": [0.05, 1.06, 0.7504]},
    },
}


def timed(work: Callable[[], object]) -> float:
    """Return the microseconds a step of a round of `work`."""
    start = time.perf_counter()
    for _ in range(STEPS_A_ROUND):
        work()
    return (time.perf_counter() - start) / STEPS_A_ROUND * 1e6


def measure() -> dict[str, float]:
    """Return medians: us a step bare and in the engine, their ratio, and what follows at 1 kHz."""
    engine = MujocoEngine("robot", MujocoParams.model_validate(SCENE))
    engine.configure(Setup(period_ns=STEP_NS, directory=Path()))
    inputs = Inputs({port.name: np.array(port.start) for port in engine.ports if port.causality == "input"})
    model = engine._model
    data = mujoco.MjData(model)
    data.qpos[:], data.ctrl[:] = engine._data.qpos, engine._data.ctrl
    now = [0]

    def step() -> None:
        engine.step(now[0], STEP_NS, inputs)
        engine.state_hash()
        now[0] += STEP_NS

    def bare() -> None:
        mujoco.mj_step(model, data)

    rounds = [(timed(bare), timed(step)) for _ in range(ROUNDS)]
    bare_us, engine_us = (statistics.median(column) for column in zip(*rounds, strict=True))
    return {
        "bare_us": bare_us,
        "engine_us": engine_us,
        "ratio": statistics.median(engine / alone for alone, engine in rounds),
        "core_beyond": statistics.median(engine - alone for alone, engine in rounds) / 1000.0,
        "real_time_factor": 1000.0 / engine_us,
    }


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON")
    figures = measure()
    if parser.parse_args().json:
        print(json.dumps(figures, indent=2))
    else:
        print("\n".join(f"{name:18} {value:.4g}" for name, value in figures.items()))


if __name__ == "__main__":
    main()
