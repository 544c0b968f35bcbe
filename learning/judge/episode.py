"""An episode on trial: a policy acts in an environment, and the course is a row of the verdict."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from learning.environments.environment import Environment
from learning.environments.registration import ENVIRONMENTS, make
from learning.judge.difficulties import DIFFICULTIES
from learning.judge.failures import classify
from learning.judge.happened import Happened
from learning.judge.policies import JudgedPolicy
from schemas.errors import TrocarError

__all__ = ["Trial", "judge_trial", "make_environment"]

Row = dict[str, Any]
_STEP_S = 0.2
"""Step of an environment, s, in which the steps of an exercise are counted."""


class Trial(NamedTuple):
    """An episode for a policy to be judged on."""

    exercise: str
    difficulty: str
    seed: int

    @property
    def name(self) -> str:
        """Name of the trial's files."""
        return f"{self.exercise}-{self.difficulty}-{self.seed:05d}"

    @property
    def world(self) -> tuple[str, float, Mapping[str, Any]]:
        """Exercise, delay and settings: trials of the same world share an environment."""
        difficulty = DIFFICULTIES[self.difficulty]
        return self.exercise, difficulty.delay, difficulty.settings(self.seed)


def make_environment(trial: Trial, wanted: Mapping[str, Any]) -> Environment:
    """Return the environment of a trial; episodes end by success or loss.

    `wanted`: further arguments, as of a policy.
    """
    exercise, delay, settings = trial.world
    return make(
        ENVIRONMENTS[f"trocar/{exercise}-v0"][0],
        terminate_on_success=True,
        delay=delay,
        settings=dict(settings),
        **wanted,
    )


def judge_trial(env: Environment, policy: JudgedPolicy, trial: Trial, recording: Path | None) -> Row:
    """Return the row of a trial; a policy that fails ends the episode, and the row says how.

    Args:
        env: the environment of the trial.
        policy: the policy.
        trial: exercise, difficulty and seed.
        recording: a new directory for the recording, or None.
    """
    options = {"record": recording} if recording else None
    observation, info = env.reset(seed=trial.seed, options=options)
    happened = Happened(env)
    limit_s = ENVIRONMENTS[f"trocar/{trial.exercise}-v0"][1] * _STEP_S
    error, ended = None, False
    try:
        policy.begin(env, trial.seed)
        while not ended and happened.steps * env.step_s < limit_s - 1e-9:
            observation, _, ended, _, info = env.step(policy.act(observation))
            happened.see_step(info)
    except (TrocarError, ArithmeticError, LookupError, TypeError, ValueError, OSError) as failure:
        error = f"{type(failure).__name__}: {failure}"  # of the policy: the suite goes on
    grasps = any(name.endswith("/held_by/PSM1") or name == "tissue/held" for name in env.layout)
    failure = classify(happened, error=error is not None, grasps=grasps, hands=len(env.exercise.hands))
    return {
        **trial._asdict(),
        "success": failure is None,
        "failure": failure.kind if failure else None,
        "decisive_s": round(failure.time_s if failure else happened.time_s, 9),
        "error": error,
        "steps": happened.steps,
        "time_s": round(happened.time_s, 9),
        "distance": happened.distance,
        "first": dict(happened.first),
        "counts": dict(happened.counts),
        "metrics": happened.metrics(),
        "state_hash": env.state_hash,
    }
