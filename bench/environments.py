"""What a step of an environment costs, beside the bare physics in it, and how often its oracle succeeds.

    python -m bench.environments                                  # all, one core
    python -m bench.environments NeedlePick PegTransfer --seeds 20
    python -m bench.environments NeedlePick --frontier            # what longer sub-steps cost in holding

*Bare* are the same sub-steps by `mj_step` alone, of the same model from the same state. Both run in turns in
this process; the least processor time of the rounds is taken of each, as others may use the machine.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from time import process_time
from typing import Any

from trocar.environments import ENVIRONMENTS, oracle  # isort: skip  (before numpy)

import gymnasium
import mujoco
import numpy as np

SUB_STEPS = ("0.5 ms", "1 ms", "2 ms", "2.5 ms", "4 ms")


def least(rounds: int, *works: Any) -> list[float]:
    """Return the least processor time, s, of each of some functions, called in turns."""
    best = [float("inf")] * len(works)
    for _ in range(rounds):
        for i, work in enumerate(works):
            begun = process_time()
            work()
            best[i] = min(best[i], process_time() - begun)
    return best


def cost(name: str, rounds: int) -> dict[str, Any]:
    """Return steps per second of one core, its parts, and the time of a reset."""
    env: Any = gymnasium.make(f"trocar/{name}-v0").unwrapped
    env.reset(seed=0)
    action, rng = np.zeros(env.action_space.shape), np.random.default_rng(0)
    robot = env._session.participant("robot")
    model, data = robot._model, robot._data
    sub_steps = round(env._count * env._session.plan.step_ns / 1e9 / model.opt.timestep)

    def step() -> None:
        action[:] = 0.3 * rng.uniform(-1.0, 1.0, action.shape)
        env.step(action)

    copy = mujoco.MjData(model)

    def bare() -> None:
        mujoco.mj_copyData(copy, model, data)
        mujoco.mj_step(model, copy, sub_steps)

    step_s, bare_s = least(rounds, step, bare)
    (reset_s,) = least(3 if not env._session.restores else 10, lambda: env.reset())
    tissue = "tissue" in env._session.plan.participants
    env.close()
    return {
        "environment": name,
        "sub_step_ms": 1e3 * model.opt.timestep,
        "steps_per_s": round(1.0 / step_s, 1),
        "bare_steps_per_s": round(1.0 / bare_s, 1),
        "share_of_bare": None if tissue else round(bare_s / step_s, 2),
        "real_time": round(0.2 / step_s, 1),
        "reset_ms": round(1e3 * reset_s, 1),
    }


def success(name: str, seeds: Sequence[int], settings: dict[str, Any] | None = None) -> dict[str, Any]:
    """Return how often the oracle succeeds, and the waypoints at which it was when it did not."""
    env: Any = gymnasium.make(f"trocar/{name}-v0", settings=settings)
    firsts, failures = list[int](), list[tuple[int, int]]()
    for seed in seeds:
        observation, info = env.reset(seed=seed)
        policy, over, count = oracle(env.unwrapped), False, 0
        while not (over or info["is_success"]):
            observation, _, ended, late, info = env.step(policy(observation))
            over, count = ended or late, count + 1
        if info["is_success"]:
            firsts.append(count)
        else:
            failures.append((seed, policy.at))
    env.close()
    return {
        "success": f"{len(firsts)} of {len(seeds)}",
        "median_steps": float(np.median(firsts)) if firsts else None,
        "most_steps": max(firsts, default=None),
        "failures": failures,
    }


def main() -> None:
    """Measure and print a line for each environment."""
    names = [name.partition("/")[2].removesuffix("-v0") for name in ENVIRONMENTS]
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("environments", nargs="*", choices=[*names, []], metavar="NAME", help="default: all")
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--seeds", type=int, default=0, help="also try the oracle with seeds from 0 on")
    parser.add_argument("--frontier", action="store_true", help="the oracle with other sub-steps as well")
    asked = parser.parse_args()
    print(f"load {os.getloadavg()}", file=sys.stderr)
    for name in asked.environments or names:
        row = cost(name, asked.rounds)
        if asked.seeds:
            row |= success(name, range(asked.seeds))
        print(json.dumps(row), flush=True)
        for sub_step in SUB_STEPS if asked.frontier else ():
            settings = {"participants.robot.timestep": sub_step}
            print(json.dumps({"sub_step": sub_step} | success(name, range(asked.seeds or 10), settings)))


if __name__ == "__main__":
    main()
