"""How often the scripted expert does the training tasks, over seeds of where things start.

python bench/tasks.py --seeds 100 --workers 2 --json

Every trial is a session in one host, in pace `fast`, without pictures. A trial succeeds if everything is
where it belongs when it ends. What fails is classified by what is left: `refused`, a command that the arm
cannot execute; `dropped`, lost on the way at least once; `missed`, jaws that closed in vain; `misplaced`, let
go elsewhere. Times are simulated; `cpu_s` is processor time of all trials, as others may use the machine.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from statistics import median
from typing import Any, NamedTuple

import trocar

TASKS = {
    "pick-and-place": {},
    "pick-and-place, proximity": {"scenario": "pick-and-place", "scene.grasp": "proximity"},
    "peg-board, one arm": {"scenario": "peg-board-surrol"},
    "peg-board, hand-off": {"scenario": "peg-board"},
    "peg-board-fls": {},
}
"""By name: the scenario where it is called otherwise, and what is set in it."""
SETTINGS = {
    "participants.robot.looks": False,
    "participants.endoscope.looks": False,
    "participants.endoscope.period": "200 s",
}
"""The endoscope draws one picture, at the start."""


class Trial(NamedTuple):
    """One session."""

    task: str
    seed: int
    outcome: str
    """`success`, or why not."""
    sim_s: float
    cpu_s: float
    attempts: float
    dropped: float
    slip_mm: float


def trial(task: str, seed: int) -> Trial:
    """Run one session."""
    values = dict(TASKS[task])
    scenario = str(values.pop("scenario", task))
    start = time.process_time()
    try:
        summary = trocar.run(
            scenario, set={**SETTINGS, **values, "scene.seed": seed}, pace="fast", one_host=True
        )
    except trocar.TrocarError as error:
        return Trial(task, seed, f"refused: {error}", 0.0, time.process_time() - start, 0.0, 0.0, 0.0)
    found = summary.measures
    attempts, dropped, placed = (float(found[name] or 0.0) for name in ("attempts", "dropped", "placed"))
    lost = "dropped" if dropped else "missed" if attempts > placed else "misplaced"
    return Trial(
        task,
        seed,
        "success" if found["done"] else lost,
        summary.sim_time_s,
        time.process_time() - start,
        attempts,
        dropped,
        1e3 * float(found.get("slip") or 0.0),
    )


def result(trials: list[Trial]) -> dict[str, Any]:
    """Return the figures of all trials of one task."""
    done = [each for each in trials if each.outcome == "success"]
    return {
        "trials": len(trials),
        "success": len(done) / len(trials),
        "failures": dict(Counter(each.outcome.partition(":")[0] for each in trials if each not in done)),
        "median_sim_s": median(each.sim_s for each in done) if done else None,
        "trials_with_a_drop": sum(each.dropped > 0 for each in trials),
        "attempts_per_trial": sum(each.attempts for each in trials) / len(trials),
        "largest_slip_mm": max(each.slip_mm for each in trials),
        "cpu_s": sum(each.cpu_s for each in trials),
    }


def main() -> None:
    """Print a table of all tasks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", choices=TASKS, action="append", help="one of the tasks; may be repeated")
    parser.add_argument("--seeds", type=int, default=20, help="how many, from --first")
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1, help="processes at a time")
    parser.add_argument("--json", action="store_true", help="print JSON")
    asked = parser.parse_args()
    tasks = asked.task or list(TASKS)
    jobs = [(task, seed) for seed in range(asked.first, asked.first + asked.seeds) for task in tasks]
    found: dict[str, list[Trial]] = {task: [] for task in tasks}
    with ProcessPoolExecutor(asked.workers) as pool:
        for each in pool.map(trial, *zip(*jobs, strict=True)):
            found[each.task].append(each)
            if not asked.json:
                print(f"{each.task:28} seed {each.seed:3}  {each.sim_s:6.1f} s  {each.outcome}", flush=True)
    table = {task: result(trials) for task, trials in found.items()}
    if asked.json:
        print(json.dumps(table, indent=2))
        return
    for task, row in table.items():
        print(f"{task:28} " + "  ".join(f"{name} {value}" for name, value in row.items()))


if __name__ == "__main__":
    main()
