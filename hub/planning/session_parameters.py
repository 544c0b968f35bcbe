"""Kinds and parameters of a session: the only way to participants beside a scenario file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pydantic import ValidationError

from hub.participant import Device, Params, Stepped
from hub.planning import registry
from hub.planning.renewal import Renewal
from schemas.errors import ScenarioError
from schemas.files import Files
from schemas.scenario import Scenario

__all__ = ["SessionParameters", "Successors"]

Successors = Mapping[str, Sequence[tuple[int, Stepped]]]
"""Successors of each participant, each with the step of the takeover, the earliest first."""


@dataclass(frozen=True)
class SessionParameters:
    """Kinds and parameters of participants over a session, and the files open to parameters.

    Building a participant imports its kind, and may run native code and read files. So the maker of a
    `SessionParameters` answers for the source: the user's own scenario, the hub joined by a host, or for a
    recording `trusted_parameters` alone (hub/recording/trust.py).
    """

    kinds: Mapping[str, str]
    last: Mapping[str, Mapping[str, Any]]
    """Parameters at the end of the session."""
    renewals: tuple[Renewal, ...]
    files: Files

    @classmethod
    def of_scenario(
        cls, scenario: Scenario, files: Files, renewals: tuple[Renewal, ...] = ()
    ) -> SessionParameters:
        """Return the kinds and parameters of all participants of a scenario."""
        specs = scenario.participants
        return cls(
            {name: spec.kind for name, spec in specs.items()},
            {name: spec.params for name, spec in specs.items()},
            renewals,
            files,
        )

    def make(self, name: str) -> tuple[Stepped | Device, list[tuple[int, Stepped]]]:
        """Return a participant of the start, and the successors, each with its first step.

        Raises ScenarioError if the kind cannot be loaded or parameters are invalid.
        """
        kind = registry.load(self.kinds[name])
        made = [kind(name, self._validate_parameters(name, params)) for params in self.parameter_stages(name)]
        steps = [one.step for one in self._renewals_of(name)]
        later = zip(steps, made[1:], strict=True)
        return made[0], [(step, one) for step, one in later if isinstance(one, Stepped)]

    def validate_last(self, name: str) -> Params:
        """Return the parameters at the end. Raises ScenarioError as `make` does."""
        return self._validate_parameters(name, self.last[name])

    def of(self, names: Iterable[str]) -> tuple[dict[str, dict[str, Any]], list[Renewal]]:
        """Return the parameters at the end of the participants `names`, and their part of the renewals."""
        names = list(names)
        return {name: dict(self.last[name]) for name in names}, [one.of(names) for one in self.renewals]

    def parameter_stages(self, name: str) -> list[Mapping[str, Any]]:
        """Return the parameters of a participant over the session, the last parameters at the end."""
        return [*(one.before[name] for one in self._renewals_of(name)), self.last[name]]

    def at(self, step: int) -> SessionParameters:
        """Return the parameters at `step`, and the earlier renewals."""
        last = dict(self.last)
        for one in sorted(self.renewals, key=lambda one: one.step, reverse=True):
            last |= one.before if one.step >= step else {}
        return replace(self, last=last, renewals=tuple(one for one in self.renewals if one.step < step))

    def _renewals_of(self, name: str) -> list[Renewal]:
        return sorted((one for one in self.renewals if name in one.before), key=lambda one: one.step)

    def _validate_parameters(self, name: str, params: Mapping[str, Any]) -> Params:
        kind = self.kinds[name]
        try:
            return registry.load(kind).params_model.model_validate(params, context=self.files.context)
        except ValidationError as error:
            raise ScenarioError(f"participant '{name}' of kind '{kind}': {error}") from error
