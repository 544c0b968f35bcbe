"""Scenario files: find, read, override and validate; every error has a line and column."""

from __future__ import annotations

import logging
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.resources import files
from itertools import islice
from pathlib import Path
from typing import Any, cast

from pydantic import ValidationError

from hub.participant import Params
from hub.planning import registry
from hub.planning.contacts import add_contacts
from hub.planning.foreign_code import foreign_code
from hub.planning.limits import MAX_PARTICIPANTS, MAX_PROBLEMS, safe_text
from hub.planning.programs import admit_programs
from hub.planning.renamed import SCENARIOS, replace_old_names
from hub.planning.scenario_source import Location, Source, read
from hub.planning.scene import spread_scene
from hub.planning.validation_errors import describe_errors
from schemas.errors import ScenarioError, did_you_mean
from schemas.files import Files
from schemas.scenario import ParticipantSpec, Scenario

__all__ = [
    "ScenarioFile",
    "installed_scenarios",
    "load",
    "locate_error",
    "scenario_families",
    "validate_source",
]

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ScenarioFile:
    """A valid scenario, the validated parameters of the participants by name, and the text."""

    scenario: Scenario
    params: Mapping[str, Params]
    source: Source


def installed_scenarios() -> dict[str, Path]:
    """Return the scenarios of the Trocar package, by name."""
    return {file.stem: file for file in sorted(Path(str(files("configs"))).glob("*.yaml"))}


def scenario_families() -> dict[str, list[str]]:
    """Return the names of the installed scenarios by subject, in the order of a first look."""
    return tomllib.loads((files("configs") / "families.toml").read_text("utf-8"))


def load(name_or_path: str, overrides: Sequence[str] = (), *, programs: bool = False) -> ScenarioFile:
    """Return the installed scenario of a name, or a scenario file, with overrides `a.b.c=value` applied.

    `programs`: open the scenario to programs. Raises ScenarioError with a line for each problem.
    """
    return validate_source(read(_find(name_or_path)), overrides, programs=programs)


def validate_source(source: Source, overrides: Sequence[str] = (), *, programs: bool = False) -> ScenarioFile:
    """Return the scenario in `source`, with overrides `a.b.c=value` applied.

    `programs`: open the scenario to programs. Raises ScenarioError with a line for each problem.
    """
    for override in overrides:
        source.override(override)
    if programs:
        admit_programs(source)
    _check_number(source)
    replace_old_names(source)
    _log_code(source)
    found = [
        str(locate_error(error, source))
        for error in islice(spread_scene(source, _parameter_models(source)), MAX_PROBLEMS)
    ]
    if len(found) == MAX_PROBLEMS:  # the scene is not spread to its end: what would be said of it is wrong
        raise ScenarioError("\n".join(found))
    params = _all_params(source, found)
    if not found:
        _make_contacts(source, params, found)
    try:
        scenario = Scenario.model_validate(source.tree)
    except ValidationError as error:
        raise ScenarioError("\n".join([*describe_errors(error, Scenario, (), source), *found])) from error
    if found:
        raise ScenarioError("\n".join(found))
    return ScenarioFile(scenario, params, source)


def locate_error(error: ScenarioError, source: Source) -> ScenarioError:
    """Return `error` with the place of the value in front of the message, if the error names a value."""
    return ScenarioError(source.line(error.path, str(error))) if error.path else error


def _find(name_or_path: str) -> Path:
    path = Path(name_or_path)
    if path.suffix or len(path.parts) > 1:
        try:
            is_file = path.is_file()
        except (OSError, ValueError) as error:  # too long, or with a character that no path has
            raise ScenarioError(f"'{safe_text(str(path))}' is not a path: {safe_text(str(error))}") from error
        if not is_file:
            raise ScenarioError(
                f"there is no scenario file '{safe_text(str(path))}' (looked in {Path.cwd()})"
            )
        return path
    known = installed_scenarios()
    if name_or_path in SCENARIOS:
        new = SCENARIOS[name_or_path]
        log.warning("scenario '%s' is now '%s'; this release still accepts the old name", name_or_path, new)
        return known[new]
    if name_or_path not in known:
        raise ScenarioError(
            f"there is no scenario '{safe_text(name_or_path)}'.{did_you_mean(name_or_path, known)} For a file"
            " of your own, give its path with .yaml."
        )
    return known[name_or_path]


def _check_number(source: Source) -> None:
    """Raise ScenarioError if there are more participants than a session may have."""
    participants = source.tree.get("participants")
    number = len(cast("dict[str, Any]", participants)) if isinstance(participants, dict) else 0
    if number > MAX_PARTICIPANTS:
        problem = f"a session of {number} participants; at most {MAX_PARTICIPANTS} are allowed"
        raise locate_error(ScenarioError(problem, path=("participants",)), source)


def _log_code(source: Source) -> None:
    """Log the code about to be imported or loaded beyond installed kinds."""
    code = foreign_code(_participant_specs(source).values(), source.tree.get("scene"))
    if code:
        more = f" and {len(code) - MAX_PROBLEMS} more" if len(code) > MAX_PROBLEMS else ""
        named = ", ".join(map(safe_text, code[:MAX_PROBLEMS]))
        log.info("this scenario runs code that is not installed as a kind: %s%s", named, more)


def _participant_specs(source: Source) -> dict[str, dict[str, Any]]:
    """Return the participants with a kind; the validation of the scenario reports the rest."""
    participants = source.tree.get("participants")
    given = cast("dict[str, Any]", participants if isinstance(participants, dict) else {})
    specs = {name: cast("dict[str, Any]", spec) for name, spec in given.items() if isinstance(spec, dict)}
    return {name: spec for name, spec in specs.items() if isinstance(spec.get("kind"), str)}


def _parameter_models(source: Source) -> dict[str, type[Params]]:
    """Return the model of the parameters of every participant with a loadable kind."""
    models: dict[str, type[Params]] = {}
    for name, spec in _participant_specs(source).items():
        with suppress(ScenarioError):  # `_all_params` reports it
            models[name] = registry.load(spec["kind"]).params_model
    return models


def _all_params(source: Source, found: list[str]) -> dict[str, Params]:
    """Return the parameters of every participant, and append the problems to `found`."""
    params: dict[str, Params] = {}
    present: set[str] = set()
    for name, spec in _participant_specs(source).items():
        try:
            params[name] = _participant_params(("participants", name), spec, source, present)
        except ScenarioError as error:
            found += str(locate_error(error, source)).splitlines()
            if len(found) >= MAX_PROBLEMS:
                del found[MAX_PROBLEMS:]
                break
    return params


def _make_contacts(source: Source, params: dict[str, Params], found: list[str]) -> None:
    """Add the contacts of the tools to the tree, and the new probes to `params`."""
    try:
        for name in add_contacts(source, params):
            spec = source.tree["participants"][name]
            params[name] = _participant_params(("participants", name), spec, source, {spec["kind"]})
    except ScenarioError as error:
        found += str(locate_error(error, source)).splitlines()


def _participant_params(at: Location, spec: dict[str, Any], source: Source, present: set[str]) -> Params:
    """Return the validated parameters of a participant.

    `present` collects the kinds with installed packages: the check takes 10 ms. Raises ScenarioError if the
    parameters are invalid, or if the participant runs here and a required package is not installed.
    """
    kind = spec["kind"]
    try:
        model = registry.load(kind).params_model
        if spec.get("host") != "remote" and kind not in present:
            registry.require_extra(kind)
            present.add(kind)
    except ScenarioError as error:
        raise ScenarioError(str(error), path=(*at, "kind")) from error
    given = {key: value for key, value in spec.items() if key not in ParticipantSpec.RESERVED}
    try:
        return model.model_validate(given, context=Files(source.directory).context)
    except ValidationError as error:
        found = describe_errors(error, model, at, source, other_keys=ParticipantSpec.RESERVED)
        raise ScenarioError("\n".join(found)) from error
    except OSError as error:  # a path that is too long or that leads through a loop of links
        raise ScenarioError(f"a file cannot be read: {safe_text(str(error))}", path=at) from error
