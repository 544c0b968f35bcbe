"""Jumps and drift of an instrument over 10 000 clutch cycles, and the time of a step of teleoperation.

The hand moves on random paths.

In each cycle the hand strays for some steps while it leads and leaps anywhere while it is free; in between
the scale changes. Jump: the largest motion of the tip in the step in which the hand takes over. Drift: how
far the tip is from where the led ways add up to, at worst, in position and in turn.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import perf_counter

import numpy as np

from controllers.teleoperation.controller import Teleoperation
from controllers.teleoperation.params import TeleoperationParams
from hub.participant import Inputs, Setup
from robots import rotation
from schemas.ros import Joy

STEP_NS = 1_000_000
STRAY, TURN = 1e-4, 2e-3
"""Standard deviations of a step of the hand, m and rad: a tenth of a metre and two radians a second."""
CASES = {"hold": {"orientation": "hold"}, "follow": {"orientation": "follow"}}


def cycles(count: int, seed: int, **params: str) -> dict[str, float]:
    """Return jump (m), drift (m, rad) and time per step (us) of `count` cycles."""
    random = np.random.default_rng(seed)
    teleoperation = Teleoperation(
        "teleop", TeleoperationParams.model_validate({"instrument": "400006", **params})
    )
    outputs = teleoperation.configure(Setup(STEP_NS, Path()))
    values = {
        port.name: np.array(port.start or ()) for port in teleoperation.ports if port.causality == "input"
    }
    values |= {"master": np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])}
    hand, scale, chain = values["master"], values["scale"], teleoperation.params.chain
    steps, spent = 0, 0.0

    def step(*clutch: int) -> np.ndarray:
        nonlocal outputs, steps, spent
        inputs = Inputs(values)
        inputs._events["buttons"] = tuple(Joy(buttons=np.array([pressed], np.int32)) for pressed in clutch)
        begin = perf_counter()
        outputs = teleoperation.step(steps * STEP_NS, STEP_NS, inputs)
        spent, steps = spent + perf_counter() - begin, steps + 1
        return chain.forward(np.array(outputs["servo_jp"]))

    tip = home = step()
    there, turned, jump, drift, turn_drift = home[:3, 3].copy(), home[:3, :3].copy(), 0.0, 0.0, 0.0
    for _ in range(count):
        for _ in range(int(random.integers(1, 4))):
            way = random.normal(0.0, STRAY, 3) + 0.1 * (home[:3, 3] - there)
            turn = random.normal(0.0, TURN, 3) + 0.02 * rotation.log(
                rotation.from_matrix(home[:3, :3] @ turned.T)
            )
            hand[:3] += way
            hand[3:] = rotation.product(rotation.exp(turn), hand[3:])
            there += scale[0] * way
            turned = (
                rotation.matrix(rotation.exp(turn)) @ turned if params["orientation"] == "follow" else turned
            )
            tip = step()
        step(1)
        hand[:3], hand[3:] = random.uniform(-0.3, 0.3, 3), rotation.exp(random.normal(0.0, 1.0, 3))
        scale[0] = random.uniform(0.1, 0.4)
        after = step(0)
        jump = max(jump, float(np.linalg.norm(after[:3, 3] - tip[:3, 3])))
        drift = max(drift, float(np.linalg.norm(after[:3, 3] - there)))
        turn_drift = max(
            turn_drift, float(np.linalg.norm(rotation.log(rotation.from_matrix(after[:3, :3] @ turned.T))))
        )
    return {
        "jump_m": jump,
        "drift_m": drift,
        "drift_rad": turn_drift,
        "us_per_step": round(1e6 * spent / steps, 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path, help="write the numbers here")
    arguments = parser.parse_args()
    found = {name: cycles(arguments.cycles, arguments.seed, **params) for name, params in CASES.items()}
    for name, numbers in found.items():
        print(f"{name:8}", "  ".join(f"{key} {value:.3g}" for key, value in numbers.items()))
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
