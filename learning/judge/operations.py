"""Operations: exercises that are whole sessions, in which a policy answers a governor, or a routine operates.

A seed is a patient. The session, its task and its limits are those of installed scenarios.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import trocar
from devices.policies.policy import BACKENDS
from learning.judge.difficulties import DIFFICULTIES
from learning.judge.failures import FAILURES
from learning.judge.policies import PolicyAddress
from robots.policies.contract import Contract
from schemas.errors import ScenarioError

__all__ = ["OPERATIONS", "OPERATION_FAILURES", "Operation", "SessionOrder"]

_STEP_NS = 2_000_000
"""Step of the scenarios."""
_NAMES = {"participants.actions.": "participants.motion.", "participants.camera.": "participants.endoscope."}
"""Participants of a session in place of those of an environment, in settings of difficulties."""
_CAMERAS = ("endoscope/left", "endoscope/right")


class SessionOrder(NamedTuple):
    """A session to be run."""

    scenario: str
    settings: Mapping[str, Any]
    """Values of the scenario, by path."""

    @property
    def overrides(self) -> list[str]:
        """The settings as `--set` takes them."""
        return [f"{path}={json.dumps(value)}" for path, value in self.settings.items()]

    def check(self) -> None:
        """Raise ScenarioError if the session cannot be planned."""
        trocar.load_scenario(self.scenario, set=self.settings)


class Operation(NamedTuple):
    """Scenarios of an operation."""

    routine: str
    """Scenario with the routine."""
    policy: str
    """Scenario with participants `policy`, `governor` and `endoscope`, and a contract."""
    seeds: int = 5
    """Trials if no other number is asked for: a session takes minutes."""

    def order(self, address: PolicyAddress, difficulty: str, seed: int) -> SessionOrder:
        """Return the session of a trial. Raises ScenarioError for a policy or difficulty of no session."""
        changed = DIFFICULTIES[difficulty]
        settings: dict[str, Any] = {"scene.seed": seed}
        for path, value in changed.settings(seed).items():
            begin = next((begin for begin in _NAMES if path.startswith(begin)), "")
            settings[path.replace(begin, _NAMES.get(begin, ""), 1)] = value
        if address.name == "expert":
            if changed.delay:
                raise ScenarioError(
                    f"difficulty '{difficulty}': the routine of '{self.routine}' has no link with a delay"
                )
            return SessionOrder(self.routine, settings)
        if address.name.partition(":")[0] not in BACKENDS:
            raise ScenarioError(
                f"policy '{address.name}' acts in environments; an operation is done by 'expert' or a policy"
                f" behind a contract: {', '.join(BACKENDS)}"
            )
        if changed.delay:
            settings["participants.policy.network_link"] = {"delay": f"{1e3 * changed.delay:g} ms"}
        return SessionOrder(self.policy, settings | self._of_policy(address, seed))

    def _of_policy(self, address: PolicyAddress, seed: int) -> dict[str, Any]:
        """Return the values that put a policy with a contract into the scenario."""
        file = trocar.load_scenario(self.policy)
        own = cast("Contract", cast("Any", file.params["governor"]).contract)
        stated = own.model_dump(mode="json", exclude_unset=True) | dict(address.contract or {})
        try:
            contract = Contract.model_validate(stated)
        except ValueError as error:
            raise ScenarioError(f"the contract is not valid: {error}") from error
        if contract.frame != own.frame:
            raise ScenarioError(f"contract: frame '{contract.frame}': '{self.policy}' has '{own.frame}'")
        period_ns = address.execute * contract.row_ns // _STEP_NS * _STEP_NS
        found: dict[str, Any] = {
            "scene.contract": stated,
            "participants.policy.backend": _absolute(address.name, Path.cwd()),
            "participants.policy.episode": seed,
            "participants.governor.execute": address.execute,
            "participants.endoscope.period": f"{period_ns} ns",
        }
        if unknown := sorted(set(contract.cameras) - set(_CAMERAS)):
            raise ScenarioError(f"contract: camera '{unknown[0]}': there are {' and '.join(_CAMERAS)}")
        sizes = {(camera.width, camera.height) for camera in contract.cameras.values()}
        if len(sizes) > 1:
            raise ScenarioError("contract: the cameras of an endoscope have one size")
        for width, height in sizes:
            found |= {"participants.endoscope.width": width, "participants.endoscope.height": height}
        if not sizes:
            lines = [(str(one.source), str(one.target)) for one in file.scenario.connections]
            kept = [ends for ends in lines if not ends[1].startswith("policy.endoscope/")]
            found["connections"] = [" -> ".join(ends) for ends in kept]
            found["participants.endoscope.images"] = "none"
        return found


def _absolute(backend: str, directory: Path) -> str:
    """Return a backend with the files below `directory` by their whole paths."""
    prefix, _, rest = backend.partition(":")
    if prefix == "python":
        module, _, name = rest.rpartition(":")
        file = directory / (module if module.endswith(".py") else f"{module.replace('.', '/')}.py")
        return f"python:{file}:{name}" if file.is_file() else backend
    file = directory / rest
    return f"{prefix}:{file}" if prefix in ("onnx", "lerobot") and file.exists() else backend


OPERATIONS: Mapping[str, Operation] = MappingProxyType(
    {"ClipAndCut": Operation("clip-and-cut", "clip-and-cut-by-policy")}
)
"""Operations by the name of the exercise."""

OPERATION_FAILURES: Mapping[str, str] = MappingProxyType(
    {
        "session failed": "the session ended with an error: see the column error",
        "policy failed": FAILURES["policy failed"],
        "common duct injured": "the common bile duct was clipped, cut or burnt",
        "hepatic artery injured": "the hepatic artery was clipped, cut or burnt",
        "bowel injured": "the bowel was burnt",
        "tube torn": "a duct or an artery was torn",
        "duct open": "the cystic duct was cut, and no clip stays with the patient",
        "artery open": "the cystic artery was cut, and no clip stays with the patient",
        "gallbladder perforated": "the gallbladder was slit, torn or burnt through",
        "bleeding": "too much blood was lost",
        "clips missing": "fewer clips stay with the patient than wanted",
        "not finished": "time ran out, or the routine gave up, before all goals were reached",
    }
)
"""Classes of failure of an operation, the gravest first."""
