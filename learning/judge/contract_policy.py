"""A policy behind a contract on trial: any backend of kind `policy`, in the world of an environment.

Its rows of actions become goals of the tips (`control: tip`), one an environment's step.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self, cast

import numpy as np
from numpy.typing import NDArray

from devices.policies.policy import Observation as Question
from devices.policies.policy import Policy, open_policy
from learning.environments.environment import Environment, Observation
from robots.dvrk.parameters import ArmName
from robots.policies.actions import ACTIONS
from robots.policies.contract import Contract
from robots.policies.states import ArmReading, encode_state
from robots.policies.terms import Terms
from robots.transform import inverse_transform, matrix_to_pose, pose_to_matrix
from schemas.errors import ScenarioError
from schemas.vectors import Vector
from tasks.instant import base_pose

__all__ = ["ContractPolicy"]

_SCENE_STEP_NS = 20_000_000
"""Step of all scenes, or a multiple of it."""
_EYES = {"camera/left": "left", "camera/right": "right"}
"""Pictures of an environment, by the contract's name of the camera."""


class ContractPolicy:
    """A policy with a contract, such as a server of openpi.

    Args:
        backend: address, as of kind `policy`.
        contract: names, units, frames and rates; arms are those of the exercise where none are stated.
        execute: rows of each answer to be executed before the next question.

    Raises ScenarioError for a contract that an environment cannot keep.
    """

    def __init__(self, backend: str, contract: Mapping[str, Any], execute: int) -> None:
        self._backend, self._execute = backend, execute
        self._stated = {"frame": "world", "rate": 25.0, "horizon": 50, **contract}
        self._contract = contract_of(self._stated)
        self._policy: Policy | None = None
        self._rows: deque[Vector] = deque()
        sizes = [(camera.width, camera.height) for camera in self._contract.cameras.values()]
        pictures = {"width": sizes[0][0], "height": sizes[0][1], "images": True} if sizes else {}
        self.environment: Mapping[str, Any] = {
            "control": "tip",
            "step": 1.0 / self._contract.rate,
            **pictures,
        }
        """Arguments of environments."""

    def begin(self, env: Environment, seed: int) -> None:
        """Open the policy for the exercise, once, and reset the policy."""
        arms = cast("tuple[ArmName, ...]", env.exercise.hands)
        params = env.exercise.task.params
        if self._policy is None:
            contract = contract_of({"arms": list(arms), **self._stated})
            if contract.arms != arms:
                raise ScenarioError(f"contract: arms {contract.arms}, but the exercise has {arms}")
            self._terms = Terms.of(contract, params.arms, params.mounting)
            self._policy = open_policy(self._backend, self._terms, directory=Path.cwd())
        self._bases = {
            arm: base_pose(params, arm) if self._contract.frame == "base" else np.eye(4) for arm in arms
        }
        self._chains = {arm: params.arms[arm].chain for arm in arms}
        self._layout, self._number, self._time_s = env.layout, 0, 0.0
        self._rows.clear()
        self._policy.reset(seed)

    def act(self, observation: Observation) -> NDArray[Any]:
        """Return the goals of the next row; without any left, ask the policy."""
        if not self._rows:
            self._ask(observation)
        self._time_s += 1.0 / self._contract.rate
        return self._rows.popleft()

    def _ask(self, observation: Observation) -> None:
        assert self._policy is not None
        readings = {arm: self._reading(arm, observation) for arm in self._bases}
        self._number += 1
        rows = self._policy.act(
            Question(
                self._number,
                {name: observation[_EYES[name]] for name in self._contract.cameras},
                encode_state(self._contract.state, [*readings.values()]).astype(np.float32),
                self._contract.instruction,
                self._time_s,
                {"goal": observation["desired_goal"]},
            )
        )
        parts = np.split(rows, len(readings), axis=1)
        goals = [
            self._goals(arm, part, reading.tip)
            for (arm, reading), part in zip(readings.items(), parts, strict=True)
        ]
        self._rows.extend(np.concatenate(goals, axis=1)[: self._execute])

    def _reading(self, arm: str, observation: Observation) -> ArmReading:
        values = np.asarray(observation["observation"], np.float64)
        seen = {name: values[self._layout[f"{arm}/{name}"]] for name in ("tip/position", "tip/orientation")}
        into = inverse_transform(self._bases[arm])
        tip = matrix_to_pose(into @ pose_to_matrix(np.concatenate([*seen.values()])))
        last = "jaw" if f"{arm}/jaw" in self._layout else "power"
        return ArmReading(np.zeros(0), float(values[self._layout[f"{arm}/{last}"]][0]), tip)

    def _goals(self, arm: str, rows: Vector, tip: Vector) -> Vector:
        """Return goals in the world, shape (rows, 8)."""
        layout = ACTIONS[self._contract.action]
        goals = layout.decode(rows, tip)
        base, chain = self._bases[arm], self._chains[arm]
        made = np.empty((len(goals), 8))
        made[:, 7] = goals[:, -1]
        for row, goal in zip(made, goals, strict=True):
            in_joints = layout.space == "joint"
            tip_in_base = chain.frames(goal[:-1])[-1] if in_joints else pose_to_matrix(goal[:7])
            row[:7] = matrix_to_pose(base @ tip_in_base)
        return made

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Release the policy."""
        if self._policy is not None:
            self._policy.close()


def contract_of(stated: Mapping[str, Any]) -> Contract:
    """Return a contract that an environment can keep. Raises ScenarioError."""
    try:
        contract = Contract.model_validate(stated)
    except ValueError as error:
        raise ScenarioError(f"the contract is not valid: {error}") from error
    if contract.state == "joint":
        raise ScenarioError("contract: state 'joint': an environment observes tips, so open-h-dvrk or none")
    if contract.frame == "camera":
        raise ScenarioError("contract: frame 'camera': an environment has the frames world and base")
    if contract.action == "joint" and contract.frame != "base":
        raise ScenarioError("contract: action 'joint' has joints of the arm's base: state frame 'base'")
    if unknown := sorted(set(contract.cameras) - set(_EYES)):
        raise ScenarioError(f"contract: camera '{unknown[0]}': environments have {' and '.join(_EYES)}")
    if len({(camera.width, camera.height) for camera in contract.cameras.values()}) > 1:
        raise ScenarioError("contract: the cameras of an environment have one size")
    if round(1e9 / contract.rate) % _SCENE_STEP_NS:
        raise ScenarioError(f"contract: rate {contract.rate:g}: an environment's step is a multiple of 20 ms")
    return contract
