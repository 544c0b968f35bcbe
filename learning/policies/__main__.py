"""Trains networks on the oracles' demonstrations: `python -m learning.policies NeedlePick -o clones`.

With `--pictures`, demonstrations are kept in files, and training needs nothing of the simulator: on a machine
with a GPU and a copy of the files the same command only trains.
"""

from __future__ import annotations

import csv
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from schemas.errors import MissingExtraError, ScenarioError


def main(
    exercises: Annotated[list[str], typer.Argument(metavar="EXERCISE...", help="Such as NeedlePick.")],
    *,
    demonstrations: Annotated[int, typer.Option(min=1, help="Episodes of the oracle with success.")] = 200,
    noise: Annotated[
        float, typer.Option(min=0.0, help="Noise on a fifth of the oracle's motions, in units of an action.")
    ] = 0.3,
    iterations: Annotated[
        int, typer.Option(min=0, help="Batches of 256 steps; 0: record demonstrations with pictures only.")
    ] = 3000,
    pictures: Annotated[
        bool, typer.Option("--pictures", help="Learn from stereo pictures instead of objects' places.")
    ] = False,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR")] = Path("clones"),
) -> None:
    """Clone the oracles of exercises: a network EXERCISE.npz each, or EXERCISE-pictures.npz."""
    if iterations and find_spec("torch") is None:
        raise MissingExtraError("training", "policy-training", "torch")
    output.mkdir(parents=True, exist_ok=True)
    for name in exercises:
        if pictures:
            _clone_from_pictures(name, demonstrations, noise, iterations, output)
        else:
            _clone_from_state(name, demonstrations, noise, max(1, iterations), output)


def _clone_from_state(name: str, count: int, noise: float, iterations: int, output: Path) -> None:
    from learning.environments.registration import make
    from learning.policies.demonstrations import demonstrate
    from learning.policies.training import train

    kind, steps = _kind_of(name)
    env = make(kind, terminate_on_success=True, hashed=False)
    episodes = list(demonstrate(env, count, steps, noise))
    env.close()
    train(episodes, iterations).save(output / f"{kind}.npz")
    taken = sum(len(episode.actions) for episode in episodes)
    typer.echo(f"{name}: {len(episodes)} demonstrations, {taken} steps: {output / kind}.npz")


def _clone_from_pictures(name: str, count: int, noise: float, iterations: int, output: Path) -> None:
    """Record missing demonstrations, then train; errors while training go to a .csv file."""
    place = output / f"{name}-demonstrations"
    place.mkdir(exist_ok=True)
    if (missing := count - len(list(place.glob("*.npz")))) > 0:
        _record(name, missing, noise, place)
    if not iterations:
        return
    from learning.policies.demonstration import load_demonstrations
    from learning.policies.picture_training import train_from_pictures

    curve = output / f"{name}-pictures.csv"
    with curve.open("w", newline="", encoding="utf-8") as opened:
        table = csv.writer(opened)
        table.writerow(["iteration", "training", "held_out"])
        for network, progress in train_from_pictures(load_demonstrations(place)[:count], iterations):
            table.writerow(progress)
            network.save(output / f"{name}-pictures.npz")
    typer.echo(f"{name}: {count} demonstrations: {output / name}-pictures.npz, {curve}")


def _record(name: str, count: int, noise: float, place: Path) -> None:
    """Record demonstrations with pictures, with seeds above all that are there."""
    from learning.environments.registration import make
    from learning.policies.demonstrations import FIRST_SEED, demonstrate
    from learning.policies.picture_policy import PICTURES

    kind, steps = _kind_of(name)
    first = max([FIRST_SEED, *(int(file.stem) + 1 for file in place.glob("*.npz"))])
    env = make(kind, terminate_on_success=True, hashed=False, **PICTURES)
    for episode in demonstrate(env, count, steps, noise, first):
        episode.save(place / f"{episode.seed}.npz")
    env.close()


def _kind_of(name: str) -> tuple[str, int]:
    """Return the class of an exercise and its steps. Raises ScenarioError."""
    from learning.environments.registration import ENVIRONMENTS

    if f"trocar/{name}-v0" not in ENVIRONMENTS:
        raise ScenarioError(f"no exercise '{name}': see docs/how-to/learn.md")
    return ENVIRONMENTS[f"trocar/{name}-v0"]


if __name__ == "__main__":
    typer.run(main)
