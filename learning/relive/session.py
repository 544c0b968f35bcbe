"""The session that relives an episode: the robot of a scenario, led by joints at the frames' times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from ruamel.yaml import YAML

import trocar
from learning.relive.arms import PlacedArm, Way
from schemas.errors import ScenarioError
from schemas.vectors import Vector

__all__ = ["Residual", "follow", "robot_of"]

_STEP_NS = 10_000_000


@dataclass(frozen=True)
class Residual:
    """How far an arm stayed from its set-points, over the frames in reach."""

    joints: Mapping[str, float]
    """Root of the mean square by joint, rad or m."""
    units: Mapping[str, str]
    tip_m: float
    """Root of the mean square distance of the tip."""
    tip_most_m: float
    """Largest distance of the tip."""


def robot_of(loaded: trocar.ScenarioFile) -> str:
    """Return the participant of kind mujoco. Raises ScenarioError if there is none."""
    for name, spec in loaded.scenario.participants.items():
        if spec.kind == "mujoco":
            return name
    raise ScenarioError(f"scenario '{loaded.scenario.name}' has no participant of kind mujoco")


def follow(
    loaded: trocar.ScenarioFile,
    arms: Mapping[str, PlacedArm],
    ways: Mapping[str, Way],
    fps: float,
    record: Path | None,
) -> dict[str, Residual]:
    """Let the arms follow their ways; return the residuals."""
    name = robot_of(loaded)
    params = dict(loaded.scenario.participants[name].params)
    params["arms"] = {arm: dict(one) for arm, one in params["arms"].items()}
    for arm, way in ways.items():
        params["arms"][arm] |= {"start": way.joints[0].tolist(), "jaw": float(way.jaw[0])}
    scenario = {
        "name": f"relive_{loaded.scenario.name}",
        "step": f"{_STEP_NS // 1_000_000} ms",
        "participants": {
            "robot": {"kind": "mujoco", **params, "publish_period": f"{_STEP_NS // 1_000_000} ms"}
        },
    }
    measured: dict[str, list[Vector]] = {arm: [] for arm in ways}
    with TemporaryDirectory() as scratch:
        file = Path(scratch) / "relive.yaml"
        yaml: Any = YAML()
        yaml.dump(scenario, file)
        with trocar.SteppedSession(trocar.load_scenario(file)) as session:
            session.restart(record)
            for i in range(len(next(iter(ways.values())).joints)):
                due = round((i + 1) * 1e9 / fps / _STEP_NS)
                inputs: dict[str, Any] = {}
                for arm, way in ways.items():
                    inputs[f"robot.{arm}/servo_jp"] = way.joints[i]
                    inputs[f"robot.{arm}/jaw/servo_jp"] = way.jaw[i : i + 1]
                session.advance(max(due - session.step, 1), inputs)
                for arm, way in ways.items():
                    measured[arm].append(np.array(session[f"robot.{arm}/measured_js"][: way.joints.shape[1]]))
    return {arm: _residual(arms[arm], way, np.array(measured[arm])) for arm, way in ways.items()}


def _residual(arm: PlacedArm, way: Way, measured: Vector) -> Residual:
    inside = way.reached > 0.0
    off = (measured - way.joints)[inside]
    apart: Vector = np.linalg.norm(arm.tip(measured[inside]) - arm.tip(way.joints[inside]), axis=1)
    joints = arm.mounted.chain.joints
    return Residual(
        {joint.name: float(np.sqrt(np.mean(off[:, i] ** 2))) for i, joint in enumerate(joints)},
        {joint.name: joint.unit for joint in joints},
        float(np.sqrt(np.mean(apart**2))),
        float(np.max(apart)),
    )
