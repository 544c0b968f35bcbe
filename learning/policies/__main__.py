"""Trains networks on the oracles' demonstrations: `python -m learning.policies NeedlePick -o clones`."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from learning.environments.registration import ENVIRONMENTS, make
from schemas.errors import MissingExtraError, ScenarioError


def main(
    exercises: Annotated[list[str], typer.Argument(metavar="EXERCISE...", help="Such as NeedlePick.")],
    *,
    demonstrations: Annotated[int, typer.Option(min=1, help="Episodes of the oracle with success.")] = 200,
    noise: Annotated[
        float, typer.Option(min=0.0, help="Noise on a fifth of the oracle's motions, in units of an action.")
    ] = 0.3,
    iterations: Annotated[int, typer.Option(min=1, help="Batches of 256 states.")] = 3000,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR")] = Path("clones"),
) -> None:
    """Clone the oracles of exercises: a network EXERCISE.npz each."""
    if find_spec("torch") is None:
        raise MissingExtraError("training", "policy-training", "torch")
    from learning.policies.demonstrations import demonstrate
    from learning.policies.training import train

    output.mkdir(parents=True, exist_ok=True)
    for name in exercises:
        if f"trocar/{name}-v0" not in ENVIRONMENTS:
            raise ScenarioError(f"no exercise '{name}': see docs/how-to/learn.md")
        kind, steps = ENVIRONMENTS[f"trocar/{name}-v0"]
        env = make(kind, terminate_on_success=True, hashed=False)
        episodes = list(demonstrate(env, demonstrations, steps, noise))
        env.close()
        train(episodes, iterations).save(output / f"{kind}.npz")
        taken = sum(len(episode.actions) for episode in episodes)
        typer.echo(f"{name}: {len(episodes)} demonstrations, {taken} steps: {output / kind}.npz")


if __name__ == "__main__":
    typer.run(main)
