"""A whole session in this process, without files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hub.observation.summary import Summary
from hub.participant import Device, Stepped
from hub.planning.registry import Role
from hub.planning.wiring import make_plan
from hub.session.launch import in_one_host
from hub.session.session import Session
from schemas.scenario import Scenario

__all__ = ["run_in_process"]


def run_in_process(
    scenario: Mapping[str, Any],
    participants: Mapping[str, Stepped | Device],
    *,
    directory: Path | None = None,
) -> Summary:
    """Run a scenario with these instances in this process, without a recording, and return the summary.

        tree = {"name": "swing", "step": "1 ms", "duration": "1 s"}
        summary = trocar.run_in_process(tree, {"pendulum": Pendulum("pendulum", PendulumParams())})

    Args:
        scenario: The tree of a scenario file; the participants in it, and their kinds, may be left out.
        participants: The instances, by name.
        directory: Where relative paths start; default: the working directory.

    Raises:
        ScenarioError: The scenario is invalid.
        SessionError: The session failed.
    """
    given: Mapping[str, Any] = scenario.get("participants", {})
    specs = {name: {"kind": type(p).__name__, **given.get(name, {})} for name, p in participants.items()}
    checked = in_one_host(Scenario.model_validate({**scenario, "participants": specs}))
    roles: dict[str, Role] = {
        name: "device" if isinstance(p, Device) else "engine" for name, p in participants.items()
    }
    plan = make_plan(checked, participants, roles)
    place = directory or Path.cwd()
    return Session(checked, plan, participants, place, endpoint="tcp/127.0.0.1:0").run()
