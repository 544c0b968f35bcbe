"""The command `trocar policy`: the contract of a scenario, and a first question to its policy."""

from __future__ import annotations

import json
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import numpy as np
import typer

from devices.policies.params import PolicyParams
from devices.policies.policy import Observation, open_policy
from hub.command_line.display import show_tables
from hub.command_line.options import Json, Overrides, ScenarioName
from hub.planning.scenario_file import load
from robots.dvrk.mounted.mounted_psm import MountedPsm
from robots.dvrk.parameters import ArmName
from robots.policies.states import ArmReading, encode_state
from robots.transform import matrix_to_pose
from schemas.errors import ScenarioError

__all__ = ["app"]

app = typer.Typer()


@app.command()
def policy(
    scenario: ScenarioName,
    *,
    overrides: Overrides = None,
    ask: Annotated[
        int,
        typer.Option(min=0, help="Questions to the policy, with grey pictures; 0: show the contract alone."),
    ] = 3,
    as_json: Json = False,
) -> None:
    """Show the contract of a scenario with its policy, check both sides, and ask the policy a few times."""
    file = load(scenario, overrides or ())
    found = [params for params in file.params.values() if isinstance(params, PolicyParams)]
    if not found:
        raise ScenarioError(
            "no participant is of kind policy (docs/how-to/policies.md)", path=("participants",)
        )
    params = found[0]
    described: dict[str, Any] = {"backend": params.backend, **params.terms.describe()}
    if ask:
        described["answers"] = _ask(params, file.source.directory, ask)
    if as_json:
        typer.echo(json.dumps(described, indent=2))
        return
    _show(params, described)


def _show(params: PolicyParams, described: dict[str, Any]) -> None:
    tables: list[Any] = [
        ((f"{what} ({layout})", "unit", "frame"), [(one.name, one.unit, one.frame) for one in fields])
        for what, layout, fields in (
            ("state", params.contract.state, params.terms.state_fields),
            ("action", params.contract.action, params.terms.action_fields),
        )
    ]
    cameras = [
        (name, *size[1::-1], params.contract.cameras[name].key) for name, size in described["cameras"].items()
    ]
    tables.append((("camera", "width", "height", "key"), cameras))
    rows = [(key, described[key]) for key in ("backend", "rate", "horizon", "instruction")]
    tables.append((("contract", ""), [*rows, *described.get("answers", {}).items()]))
    show_tables([table for table in tables if table[1]])


def _ask(params: PolicyParams, directory: Path, count: int) -> dict[str, Any]:
    """Return metadata, shape and times of answers; raises the errors of `open_policy` and of an answer."""
    terms = params.terms
    images = {
        name: np.full((camera.height, camera.width, 3), 128, np.uint8)
        for name, camera in terms.cameras.items()
    }
    state = encode_state(terms.contract.state, [_start(params, arm) for arm in terms.contract.arms])
    policy = open_policy(
        params.backend, terms, timeout_s=params.timeout * 1e-9, directory=directory, python=params.python
    )
    try:
        policy.reset(params.episode)
        shapes, times_ms = set[str](), list[float]()
        for number in range(1, count + 1):
            start = perf_counter()
            question = Observation(number, images, state.astype(np.float32), terms.contract.instruction)
            shapes.add(" x ".join(str(n) for n in policy.act(question).shape))
            times_ms.append(1e3 * (perf_counter() - start))
        return {
            "rows of answers": ", ".join(sorted(shapes)),
            "first answer, ms": round(times_ms[0], 1),
            "median, ms": round(float(np.median(times_ms)), 1),
            "metadata": str(dict(policy.metadata)),
        }
    finally:
        policy.close()


def _start(params: PolicyParams, arm: ArmName) -> ArmReading:
    """Return an arm at its start, in its own base frame."""
    held = params.arms.present_arms[arm]
    joints = np.array(held.start)
    jaw = held.jaw if isinstance(held, MountedPsm) else 0.0
    return ArmReading(joints, jaw, matrix_to_pose(held.chain.forward(joints)))
