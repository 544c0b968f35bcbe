"""How often the scripted expert does the training tasks, over seeds of where things start.

python bench/tasks.py --seeds 100 --workers 2 --trials trials.jsonl

Every trial is a session in one host, in pace `fast`, without pictures. A trial succeeds if everything is
where it belongs when it ends. What fails is classified: `refused`, a command that the arm cannot execute;
`not reachable`, `lost`, `blocked`, what the expert says of a thing that it leaves; `timeout`, the session's
duration was over. With `--trials` each trial is a line of that file as soon as it is over, and those that are
in it already are not run again. Times are simulated; `cpu_s` is processor time of all trials, as others may
use the machine.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import trocar
from hub.hosting.end_with_parent import NEEDS_INPUT, end_with_parent

TASKS = {
    "pick-and-place": {},
    "pick-and-place, proximity": {"scenario": "pick-and-place", "scene.grasp": "proximity"},
    "peg-board, one arm": {"scenario": "peg-board-surrol"},
    "peg-board, one arm, one ring": {
        "scenario": "peg-board-surrol",
        "scene.objects": {
            "ring1": {
                "kind": "triangle",
                "ring": "surrol",
                "position": ["105 mm", "1097 mm", "812.25 mm"],
                "scatter": ["1 mm", "1 mm", "30 deg"],
            }
        },
    },
    "peg-board, hand-off": {"scenario": "peg-board"},
    "peg-board, there and back": {
        "scenario": "peg-board",
        "participants.lead.legs": 2,
        "participants.task.legs": 2,
    },
    "peg-board-fls": {},
}
"""By name: the scenario where it is called otherwise, and what is set in it."""
SETTINGS = {
    "participants.robot.looks": False,
    "participants.endoscope.looks": False,
    "participants.endoscope.period": "200 s",
}
"""The endoscope draws one picture, at the start."""


FAILURES = ("not_reachable", "lost", "blocked")
"""What the expert counts of things that it leaves."""
MEASURES = ("attempts", "dropped", "finished", *FAILURES)


class Trial(NamedTuple):
    """One session."""

    task: str
    seed: int
    outcome: str
    """`success`, or why not."""
    sim_s: float
    cpu_s: float
    attempts: float = 0.0
    dropped: float = 0.0
    slip_mm: float = 0.0
    surrol: float | None = None
    """When all objects first were where they belong by the rules of SurRoL, s."""
    icra2026: float | None = None
    """Points by the rules of the challenge."""


def trial(task: str, seed: int) -> Trial:
    """Run one session."""
    values = dict(TASKS[task])
    scenario = str(values.pop("scenario", task))
    outputs = {"finished": "done"}
    values |= {
        f"measure.{name}": {"kind": "final", "of": f"lead.{outputs.get(name, name)}"} for name in MEASURES
    }
    start = time.process_time()
    try:
        summary = trocar.run(
            scenario, set={**SETTINGS, **values, "scene.seed": seed}, pace="fast", one_host=True
        )
    except trocar.TrocarError as error:
        return Trial(task, seed, f"refused: {error}", 0.0, time.process_time() - start)
    found = summary.measures
    left = [name.replace("_", " ") for name in FAILURES if found[name]]
    rules = summary.scores["task"]["rules"]
    return Trial(
        task,
        seed,
        "success" if found["finished"] else " and ".join(left) or "timeout",
        summary.sim_time_s,
        time.process_time() - start,
        float(found["attempts"] or 0.0),
        float(found["dropped"] or 0.0),
        1e3 * float(found.get("slip") or 0.0),
        rules["surrol"]["first_success"]["value"],
        rules["icra2026"]["points"]["value"],
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
        "within_50_steps_of_surrol": sum(each.surrol is not None and each.surrol <= 10.0 for each in trials),
        "within_150_steps_of_surrol": sum(each.surrol is not None and each.surrol <= 30.0 for each in trials),
        "cpu_s": sum(each.cpu_s for each in trials),
    }


def main() -> None:
    """Print a table of all tasks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", choices=TASKS, action="append", help="one of the tasks; may be repeated")
    parser.add_argument("--seeds", type=int, default=20, help="how many, from --first")
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--workers", type=int, default=1, help="processes at a time")
    parser.add_argument(
        "--trials", type=Path, help="a file with a line for each trial, which is gone on with"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    asked = parser.parse_args()
    tasks = asked.task or list(TASKS)
    found = _known(asked.trials)
    jobs = [(task, seed) for seed in range(asked.first, asked.first + asked.seeds) for task in tasks]
    with ProcessPoolExecutor(asked.workers, initializer=_begin, initargs=(os.getpid(),)) as pool:
        running = [pool.submit(trial, *job) for job in jobs if job not in found]
        for future in as_completed(running):
            each = future.result()
            found[each.task, each.seed] = each
            if asked.trials:
                with asked.trials.open("a") as file:
                    file.write(json.dumps(each._asdict()) + "\n")
            if not asked.json:
                print(f"{each.task:28} seed {each.seed:3}  {each.sim_s:6.1f} s  {each.outcome}", flush=True)
    by_task = {task: [found[job] for job in jobs if job[0] == task] for task in tasks}
    table = {task: result(trials) for task, trials in by_task.items()}
    if asked.json:
        print(json.dumps(table, indent=2))
        return
    for task, row in table.items():
        print(f"{task:28} " + "  ".join(f"{name} {value}" for name, value in row.items()))


def _begin(parent: int) -> None:
    """Let a worker end with the process that has started it, also when that is killed; only on Linux."""
    if not NEEDS_INPUT:
        end_with_parent(parent)


def _known(file: Path | None) -> dict[tuple[str, int], Trial]:
    """Return the trials that are in a file, by task and seed."""
    if file is None or not file.exists():
        return {}
    trials = [Trial(**json.loads(line)) for line in file.read_text().splitlines()]
    return {(each.task, each.seed): each for each in trials}


if __name__ == "__main__":
    main()
