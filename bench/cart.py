"""What the whole patient cart with six objects costs at 1 kHz.

python bench/cart.py --json

Measured are bare `mj_step`, the MuJoCo engine, and a session in pace `fast`, all in the same process in
turns, on models of the same scene; the lowest of the rounds. `core_beyond` is the share of one core at 1 kHz
that the engine (state hash included) takes beyond bare `mj_step`, `session_core_beyond` that of a session in
one host that is not recorded. Times are processor time of the thread that steps, as others may use the
machine; the real-time factors are those of an idle core.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.participant import Inputs, Setup
from hub.planning.plan import PlannedParticipant
from hub.session.launch import plan_of
from hub.session.session import Session
from schemas.lockstep import Ack
from schemas.scenario import Scenario

STEP_NS = 1_000_000
ROUNDS = 10
STEPS_A_ROUND = 500
SCENE: dict[str, Any] = {
    "mounting": "cart",
    "timestep": "1 ms",
    "looks": False,
    "arms": {
        "PSM1": {"instrument": "400006"},
        "PSM2": {"instrument": "400006"},
        "PSM3": {"instrument": "400049"},
        "ECM": {},
    },
    "table": {"position": [0.054, 1.11, 0.75]},
    "objects": {
        **{f"block{i}": {"kind": "block", "position": [0.02 * i, 1.11, 0.7603]} for i in range(4)},
        "ring": {"kind": "ring", "position": [0.05, 1.16, 0.751]},
        "needle": {"kind": "needle", "position": [0.05, 1.06, 0.7504]},
    },
}


def timed(work: Callable[[], object]) -> float:
    """Return the microseconds a step of a round of `work`."""
    start = time.thread_time()
    for _ in range(STEPS_A_ROUND):
        work()
    return (time.thread_time() - start) / STEPS_A_ROUND * 1e6


def session_us() -> float:
    """Return the microseconds of a step of a session, in its second half, when the objects are at rest."""
    duration_s = 2 * STEPS_A_ROUND * STEP_NS / 1e9
    scenario = Scenario.model_validate(
        {
            "name": "cart",
            "step": "1 ms",
            "duration": duration_s,
            "participants": {"robot": {"kind": "mujoco"}},
        }
    )
    plan, participants = plan_of(scenario, {"robot": MujocoParams.model_validate(SCENE)})
    reported: list[tuple[int, float]] = []

    def on_ack(_member: PlannedParticipant, ack: Ack) -> None:
        reported.append((ack.step, time.thread_time()))

    Session(scenario, plan, participants, Path(), endpoint="tcp/127.0.0.1:0", on_ack=on_ack).run()
    (first, begun), (last, ended) = reported[len(reported) // 2], reported[-1]
    return (ended - begun) / (last - first) * 1e6


def measure() -> dict[str, float]:
    """Return us a step bare, in the engine and in a session, and what follows at 1 kHz."""
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

    timed(bare), timed(step)
    rounds = [(timed(bare), timed(step), session_us()) for _ in range(ROUNDS)]
    bare_us, engine_us, whole_us = (min(column) for column in zip(*rounds, strict=True))
    return {
        "bare_us": bare_us,
        "engine_us": engine_us,
        "session_us": whole_us,
        "core_beyond": (engine_us - bare_us) / 1000.0,
        "session_core_beyond": (whole_us - bare_us) / 1000.0,
        "real_time_factor": 1000.0 / engine_us,
        "session_real_time_factor": 1000.0 / whole_us,
    }


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON")
    figures = measure()
    if parser.parse_args().json:
        print(json.dumps(figures, indent=2))
    else:
        print("\n".join(f"{name:25} {value:.4g}" for name, value in figures.items()))


if __name__ == "__main__":
    main()
