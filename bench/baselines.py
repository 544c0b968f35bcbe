"""The table of baselines in docs/baselines.md: how often simple policies succeed.

    python -m bench.baselines                           # 100 seeds; trains the clones if there are none
    python -m bench.baselines --exercises NeedlePick --seeds 20 --difficulties nominal,latency-100

Expert: the oracle. Clone: behaviour cloning from state (learning/policies). Replay: the oracle's actions of
one demonstration, whatever is seen. Random: uniform actions. Trials have seeds from 0 on, demonstrations from
10000 on. The same command goes on with an interrupted table.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import trocar.environments  # isort: skip  # noqa: F401  (before numpy)

import numpy as np

from learning.environments.environment import Environment, Observation
from learning.environments.registration import ENVIRONMENTS, make
from learning.judge.difficulties import difficulties_of
from learning.judge.policies import PolicyAddress
from learning.judge.suites import exercises_of
from learning.judge.summary import Result, results_of
from learning.judge.verdict import Verdict
from learning.own_directory import claim_directory
from learning.policies.demonstrations import demonstrate

POLICIES = {
    "expert": "expert",
    "clone": "learning.policies.cloned_policy:ClonedPolicy",
    "replay": "bench.baselines:Replay",
    "random": "random",
}


class Replay:
    """The oracle's actions of the first demonstration, whatever is seen; then no motion."""

    environment: Mapping[str, Any] = MappingProxyType({})

    def __init__(self) -> None:
        self._recorded: dict[str, np.ndarray] = {}

    def begin(self, env: Environment, seed: int) -> None:
        """Know the actions of the exercise."""
        kind = type(env.exercise).__name__
        if kind not in self._recorded:
            steps = next(steps for name, steps in ENVIRONMENTS.values() if name == kind)
            own = make(kind, terminate_on_success=True, hashed=False)
            (episode,) = demonstrate(own, 1, steps, 0.0)
            own.close()
            self._recorded[kind] = episode.actions
        self._left = list(self._recorded[kind])
        self._action = self._left[0]

    def act(self, observation: Observation) -> np.ndarray:
        """Return the next action."""
        if self._left:
            self._action = self._left.pop(0)
            return self._action
        still = self._action.reshape(-1, 5).copy()
        still[:, :4] = 0.0
        return still.ravel()


def judge(policy: str, exercise: str, asked: argparse.Namespace) -> list[Result]:
    """Return the results of a policy in an exercise, by difficulty."""
    place = asked.directory / f"{exercise}-{policy}"
    verdict = Verdict(
        PolicyAddress(POLICIES[policy]),
        (exercise,),
        difficulties_of(asked.difficulties),
        asked.seeds,
        place,
        recorded=False,
    )
    with claim_directory(place, "verdict"):
        verdict.open()
        for _ in verdict.run(asked.jobs):
            pass
    return results_of(verdict.rows())


def cell(result: Result) -> str:
    """Return a cell of the table: successes, interval, and the most frequent failure."""
    rate = result.rate
    failure = next(iter(result.failures.items()), None)
    text = f"{rate.value:.2f} ({rate.low:.2f} to {rate.high:.2f})"
    return text + (f"; {failure[0]} {failure[1]}" if failure else "")


def main() -> None:
    """Judge the policies and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--exercises", default="NeedlePick,PegTransfer,NeedleHandOver")
    parser.add_argument("--difficulties", default="nominal")
    parser.add_argument("--policies", default=",".join(POLICIES))
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--directory", type=Path, default=Path("build/baselines"))
    asked = parser.parse_args()
    policies = asked.policies.split(",")
    print("| exercise | difficulty |", " | ".join(policies), "|")
    print("|" + "---|" * (2 + len(policies)))
    for name in exercises_of(asked.exercises):
        if "clone" in policies and not (Path("clones") / f"{kind_of(name)}.npz").is_file():
            subprocess.run([sys.executable, "-m", "learning.policies", name], check=True)
        for row in zip(*(judge(policy, name, asked) for policy in policies), strict=True):
            print(f"| {name} | {row[0].difficulty} |", " | ".join(map(cell, row)), "|", flush=True)


def kind_of(exercise: str) -> str:
    """Return the class of an exercise."""
    return ENVIRONMENTS[f"trocar/{exercise}-v0"][0]


if __name__ == "__main__":
    main()
