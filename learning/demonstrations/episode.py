"""One demonstration: an expert's run with a seed, and its data set of one episode."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from learning.datasets.conversion import Conversion
from learning.datasets.episode import Wanted
from learning.own_directory import whole_file
from learning.sweeps.trial import run_trial
from schemas.errors import TrocarError

__all__ = ["ENVIRONMENT", "Order", "demonstrate"]

ENVIRONMENT = "trocar/"
"""Begin of the id of an environment, which its oracle solves."""


@dataclass(frozen=True)
class Order:
    """What to demonstrate, and what to keep of it."""

    scenario: str
    """Name or path of a scenario with a scripted expert, or id of an environment."""
    overrides: tuple[str, ...]
    """Values for `--set`."""
    wanted: Wanted


def demonstrate(order: Order, seed: int, place: str) -> dict[str, Any]:
    """Run the expert with `seed`; write `place`.json and, after a success, the data set `place`.

    Returns the content of the file: `seed`, `failure` (empty after a success), `state_hash`.
    """
    directory, recording = Path(place), Path(f"{place}.recording")
    for left in (directory, recording):
        shutil.rmtree(left, ignore_errors=True)
    failure, state_hash = _run(order, seed, recording)
    if not failure:
        failure = _convert(order, seed, recording, directory)
    shutil.rmtree(recording, ignore_errors=True)
    row = {"seed": seed, "failure": failure, "state_hash": state_hash}
    with whole_file(Path(f"{place}.json")) as part:
        part.write_text(json.dumps(row) + "\n", encoding="utf-8")
    return row


def _run(order: Order, seed: int, recording: Path) -> tuple[str, str]:
    """Return why the expert failed, or nothing, and the state hash."""
    if order.scenario.startswith(ENVIRONMENT):
        return _run_oracle(order, seed, recording)
    row = run_trial(order.scenario, [*order.overrides, f"scene.seed={seed}"], str(recording))
    if row["error"] is not None:
        return str(row["error"]), ""
    if row["done"] != 1.0:
        return "the task was not done", ""
    return (f"no success: {row['outcome']}" if row["succeeded"] is False else ""), row["state_hash"]


def _run_oracle(order: Order, seed: int, recording: Path) -> tuple[str, str]:
    import gymnasium

    from trocar.environments import oracle

    settings = dict(each.split("=", 1) for each in order.overrides)
    try:
        env: Any = gymnasium.make(
            f"trocar.environments:{order.scenario}", record=recording, settings=settings
        )
        try:
            observation, info = env.reset(seed=seed)
            policy, over = oracle(env.unwrapped), False
            while not over and not info["is_success"]:
                observation, _, ended, late, info = env.step(policy(observation))
                over = ended or late
            found = "" if info["is_success"] else "the goal was not reached", env.unwrapped.state_hash
        finally:
            env.close()
    except TrocarError as error:
        return str(error), ""
    return found


def _convert(order: Order, seed: int, recording: Path, directory: Path) -> str:
    """Write the data set of one episode; return why it cannot be, or nothing."""
    wanted, source = order.wanted, recording
    if order.scenario.startswith(ENVIRONMENT):
        source = next(recording.iterdir())
    if wanted.randomise is not None:
        wanted = replace(wanted, randomise=wanted.randomise + seed)
    directory.mkdir(parents=True)
    try:
        with Conversion(directory, wanted) as conversion:
            note = conversion.add(source)
    except (TrocarError, OSError) as error:
        return str(error)
    return "" if conversion.is_whole else note or "nothing was recorded"
