"""From a scenario to a session ready to run."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path
from time import time_ns
from typing import Any

from hub.participant import Device, Params, Stepped
from hub.planning import registry
from hub.planning.contacts import missing_contacts
from hub.planning.plan import Plan
from hub.planning.scenario_file import ScenarioFile
from hub.planning.wiring import make_plan
from hub.recording.file_hashes import file_hashes
from hub.recording.fork_origin import ATTACHMENT, ForkOrigin
from hub.security import revoked
from hub.security.access import access_settings
from hub.security.credentials import HUB, examine, load
from hub.security.gate import Gate
from hub.session.past import Past
from hub.session.session import Session
from hub.session.step_loop import OnAck
from hub.transport.loopback_port import LoopbackPort
from hub.transport.router_client import RouterClient
from schemas.scenario import Scenario

__all__ = ["Continuation", "attachments_of", "in_one_host", "launch", "plan_of"]


@dataclass(frozen=True)
class Continuation:
    """A fork: the continuation of a recorded session."""

    plan: Plan
    """Plan of the scenario, with the start values of the parent."""
    past: Past
    origin: ForkOrigin
    """Origin of the fork, kept in the recording."""
    on_ack: OnAck
    """Is called with every ack."""


def plan_of(scenario: Scenario, params: Mapping[str, Params]) -> tuple[Plan, dict[str, Stepped | Device]]:
    """Return plan and participants of `scenario`, not configured; raises ScenarioError."""
    kinds = {name: spec.kind for name, spec in scenario.participants.items()}
    participants = {name: registry.load(kind)(name, params[name]) for name, kind in kinds.items()}
    return (
        make_plan(scenario, participants, {name: registry.find(kind).role for name, kind in kinds.items()}),
        participants,
    )


def in_one_host(scenario: Scenario) -> Scenario:
    """Return `scenario` with every participant in the hub's own process."""
    participants = {
        name: spec.model_copy(update={"host": "hub"}) for name, spec in scenario.participants.items()
    }
    return scenario.model_copy(update={"participants": participants})


def launch(
    loaded: ScenarioFile,
    *,
    endpoint: str | LoopbackPort | None = None,
    outside: Sequence[str] = (),
    certificates: Path | None = None,
    record: Path | None = None,
    one_host: bool = False,
    profile: bool = False,
    continuation: Continuation | None = None,
) -> Session:
    """Return a session of a scenario file, ready to run; `one_host` puts every participant into this process.

    `outside` are the endpoints for remote machines to join by TLS, with the hub's certificate from
    `certificates`, by default this user's directory. `profile` measures the use of time. A fork is the
    `continuation` of a recorded session.
    """
    scenario = in_one_host(loaded.scenario) if one_host else loaded.scenario
    plan, participants = plan_of(scenario, loaded.params)
    directory = loaded.source.directory
    here = {name: p for name, p in participants.items() if plan.participants[name].host == "hub"}
    successors: dict[str, list[tuple[int, Stepped]]] = {}
    if continuation is not None:
        plan = continuation.plan
        for name in here:
            here[name], successors[name] = continuation.past.parameters.make(name)
    attachments = {} if record is None else attachments_of(scenario, plan, loaded)
    if continuation is not None:
        attachments[ATTACHMENT] = continuation.origin.model_dump_json(indent=2).encode()
    foreign = {name: p.foreign_keys for name, p in participants.items() if isinstance(p, RouterClient)}
    gate = _gate(outside, certificates, access_settings(plan, scenario.name, foreign)) if outside else None
    return Session(
        scenario,
        plan,
        here,
        directory,
        endpoint=endpoint,
        gate=gate,
        foreign_keys=[key for keys in foreign.values() for key in keys],
        open_to_programs=any(
            isinstance(p, RouterClient) and not p.demands_secret for p in participants.values()
        ),
        record=record,
        attachments=attachments,
        past=None if continuation is None else continuation.past,
        successors=successors,
        on_ack=None if continuation is None else continuation.on_ack,
        profile=profile,
        missing_contacts=missing_contacts(loaded.params, scenario.bonds),
    )


def _gate(endpoints: Sequence[str], certificates: Path | None, access: dict[str, Any]) -> Gate:
    """Return a gate with rules of `access`; raises ConnectError if the hub has no valid certificate."""
    credentials = load(HUB, certificates)
    examine(credentials)
    return Gate(endpoints, credentials.listening() | access, credentials.file.parent / revoked.FILE)


def attachments_of(scenario: Scenario, plan: Plan, loaded: ScenarioFile) -> dict[str, bytes]:
    """Return the attachments of a recording, enough to read and re-simulate the run elsewhere."""
    source = loaded.source
    versions = {"python": platform.python_version(), "platform": platform.platform()}
    versions |= {d.name: d.version for d in sorted(distributions(), key=lambda d: d.name.lower())}
    read_here = [
        params for name, params in loaded.params.items() if scenario.participants[name].host != "remote"
    ]
    origin = {
        "directory": str(source.directory),
        "overrides": sorted(set(source.overrides.values())),
        "started_ns": time_ns(),
    }
    return {
        "scenario.yaml": source.text.encode(),
        "scenario.json": scenario.model_dump_json(indent=2).encode(),
        "plan.json": plan.model_dump_json(indent=2).encode(),
        "origin.json": json.dumps(origin, indent=2).encode(),
        "files.json": json.dumps(file_hashes(read_here, source.directory), indent=2).encode(),
        "versions.json": json.dumps(versions, indent=2).encode(),
    }
