"""The table of baselines in docs/baselines.md: how often simple policies succeed.

    python -m bench.baselines                           # 100 seeds; trains the clones if there are none
    python -m bench.baselines --exercises NeedlePick --seeds 20 --difficulties nominal,latency-100
    python -m bench.baselines --curve clones/NeedlePick-pictures.csv docs/pictures/picture-training.svg

Expert: the oracle. Clone: behaviour cloning from state (learning/policies). Pictures: behaviour cloning from
pictures, where clones/ has a network; its training wants a GPU. Replay: the oracle's actions of one
demonstration, whatever is seen. Random: uniform actions. Trials have seeds from 0 on, demonstrations from
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
    "pictures": "learning.policies.picture_policy:PicturePolicy",
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
    parser.add_argument("--curve", type=Path, nargs=2, metavar=("CSV", "FILE"), help="draw a curve only")
    asked = parser.parse_args()
    if asked.curve:
        draw_curve(*asked.curve)
        return
    policies = asked.policies.split(",")
    print("| exercise | difficulty |", " | ".join(policies), "|")
    print("|" + "---|" * (2 + len(policies)))
    for name in exercises_of(asked.exercises):
        if "clone" in policies and not (Path("clones") / f"{kind_of(name)}.npz").is_file():
            subprocess.run([sys.executable, "-m", "learning.policies", name], check=True)
        results = [measured(policy, name, asked) for policy in policies]
        for i, difficulty in enumerate(difficulties_of(asked.difficulties)):
            cells = [cell(each[i]) if each else "not measured" for each in results]
            print(f"| {name} | {difficulty} |", " | ".join(cells), "|", flush=True)


def measured(policy: str, exercise: str, asked: argparse.Namespace) -> list[Result]:
    """Return the results by difficulty; none of a policy from pictures without its network."""
    if policy == "pictures" and not (Path("clones") / f"{kind_of(exercise)}-pictures.npz").is_file():
        return []
    return judge(policy, exercise, asked)


def draw_curve(table: Path, file: Path) -> None:
    """Draw the errors of a training from pictures over its batches."""
    import matplotlib as mpl

    mpl.use("Agg")
    mpl.rcParams["svg.hashsalt"] = "trocar"
    from matplotlib import pyplot as plt

    batches, training, held_out = np.loadtxt(table, delimiter=",", skiprows=1).T
    figure, axes = plt.subplots(figsize=(5.5, 3.0), layout="constrained")
    axes.plot(batches, training, color="#1f6f8b", label="demonstrations trained on")
    axes.plot(batches, held_out, color="#c8553d", label="held out")
    axes.set(xlabel="batches of 256 steps", ylabel="mean absolute error of actions", ylim=(0.0, None))
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", alpha=0.3)
    axes.legend(frameon=False)
    figure.savefig(file, metadata={"Date": None} if file.suffix == ".svg" else None)


def kind_of(exercise: str) -> str:
    """Return the class of an exercise."""
    return ENVIRONMENTS[f"trocar/{exercise}-v0"][0]


if __name__ == "__main__":
    main()
