"""What a step of an environment costs, beside the bare physics in it, and how often its oracle succeeds.

    python -m bench.environments                                  # all, one core
    python -m bench.environments NeedlePick PegTransfer --seeds 20
    python -m bench.environments NeedlePick --frontier            # what longer sub-steps cost in holding
    python -m bench.environments NeedlePick --vector              # eight in threads beside two in processes

*Bare* are the same sub-steps by `mj_step` alone, of the same model from the same state. Both run in turns in
this process; the least processor time of the rounds is taken of each, as others may use the machine.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

from trocar.environments import ENVIRONMENTS, oracle  # isort: skip  (before numpy)

import gymnasium
import mujoco
import numpy as np
from gymnasium.vector import AsyncVectorEnv

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


def vector_rates(name: str, rounds: int) -> dict[str, Any]:
    """Return steps/s, and core-milliseconds a step, of 8 environments in threads and of 2 in 2 processes.

    Both run in turns on the same cores; the best of the rounds counts.
    """
    make = partial(gymnasium.make, f"trocar.environments:trocar/{name}-v0")
    processes = AsyncVectorEnv([make, make], context="spawn")
    threads: Any = gymnasium.make_vec(f"trocar/{name}-v0", num_envs=8)
    own = os.getpid()
    sides = {
        "processes": (processes, 2, [own, *(process.pid for process in processes.processes)]),
        "threads": (threads, 8, [own]),
    }
    found: dict[str, Any] = {"environment": name, "load": os.getloadavg()[0]}
    for _ in range(rounds):
        for side, (envs, count, pids) in sides.items():
            rng = np.random.default_rng(0)
            envs.reset(seed=0)
            begun, busy = perf_counter(), _processor_time(pids)
            for _ in range(400 // count):
                envs.step(0.3 * rng.uniform(-1.0, 1.0, envs.action_space.shape))
            rate, cost = 400 / (perf_counter() - begun), (_processor_time(pids) - busy) / 400 * 1e3
            found[f"{side}_steps_per_s"] = round(max(rate, found.get(f"{side}_steps_per_s", 0.0)), 1)
            found[f"{side}_core_ms"] = round(min(cost, found.get(f"{side}_core_ms", 1e9)), 3)
    processes.close()
    threads.close()
    return found


def _processor_time(pids: Sequence[int]) -> float:
    """Return the processor time of processes so far, s."""
    files = (Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split() for pid in pids)
    return sum(int(file[11]) + int(file[12]) for file in files) / os.sysconf("SC_CLK_TCK")


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
    parser.add_argument("--vector", action="store_true", help="many at once, in threads and in processes")
    asked = parser.parse_args()
    print(f"load {os.getloadavg()}", file=sys.stderr)
    for name in asked.environments or names:
        if asked.vector:
            print(json.dumps(vector_rates(name, asked.rounds)), flush=True)
            continue
        row = cost(name, asked.rounds)
        if asked.seeds:
            row |= success(name, range(asked.seeds))
        print(json.dumps(row), flush=True)
        for sub_step in SUB_STEPS if asked.frontier else ():
            settings = {"participants.robot.timestep": sub_step}
            print(json.dumps({"sub_step": sub_step} | success(name, range(asked.seeds or 10), settings)))


if __name__ == "__main__":
    main()
