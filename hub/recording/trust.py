"""The trust check of a recording: without trust, installed kinds and files with recorded contents only.

Anyone may have made a recording. The scenario, the plan and the renewals of a fork can name any class,
library, FMU or file of this machine; building a participant would run or read it.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, cast

from hub.planning import registry
from hub.planning.foreign_code import names_class
from hub.planning.limits import MAX_PROBLEMS, safe_text
from hub.planning.parameter_paths import parameter_paths
from hub.planning.plan import PlannedParticipant
from hub.planning.session_parameters import SessionParameters
from hub.recording.fork_origin import fork_origin
from hub.recording.recording import Recording
from schemas.errors import RecordingError, TrustError
from schemas.files import Files, has_contents

__all__ = ["recorded_files", "trusted_parameters"]

log = logging.getLogger(__name__)


def trusted_parameters(
    recording: Recording, names: Iterable[str], directory: Path | None = None, *, trust: bool = False
) -> SessionParameters:
    """Return kinds and parameters of participants, checked before any import and any reading.

    Args:
        recording: The recording; plan, scenario and renewals need not fit together.
        names: The participants to be made or drawn.
        directory: The start of relative paths, by default the recorded directory.
        trust: Allow classes not installed, native code, and files with changed contents, each with a
            line in the log.

    Raises TrustError with the list of all demands, RecordingError if plan, scenario and renewals contradict
    each other or the installed kinds, and ScenarioError if a kind cannot be loaded.
    """
    recording.warn_if_newer()
    files = recorded_files(recording, directory, trust=trust)
    recorded = set(recording.files().values())
    origin, scenario = fork_origin(recording), recording.scenario()
    specs, planned = scenario.participants, recording.plan().participants
    parameters = SessionParameters.of_scenario(scenario, files, () if origin is None else origin.renewals)
    asked: list[str] = []
    for name in names:
        if name not in specs or name not in planned:
            lacks = "scenario" if name not in specs else "plan"
            raise RecordingError(f"'{recording.file}': its {lacks} has no participant '{safe_text(name)}'")
        kind, stages = specs[name].kind, list(parameters.parameter_stages(name))
        if not trust and (
            found := [what for params in stages for what in _unseen_demands(kind, params, files.directory)]
        ):
            asked += _of(name, found)
            continue
        _check_kind(recording, planned[name], kind)
        for params in stages:
            if trust:
                _log_other_files(kind, params, files.directory, recorded)
            else:
                asked += _of(name, _installed_demands(kind, params, files))
    if asked := list(dict.fromkeys(asked)):
        more = f"; and {len(asked) - MAX_PROBLEMS} more" if len(asked) > MAX_PROBLEMS else ""
        raise TrustError(
            f"'{recording.file}' asks for more than installed kinds and the files it was recorded with:"
            f" {'; '.join(asked[:MAX_PROBLEMS])}{more}. Code runs with all your rights. If you trust this"
            " recording, allow it with --trust (in Python: trust=True)."
        )
    return parameters


def recorded_files(recording: Recording, directory: Path | None = None, *, trust: bool = False) -> Files:
    """Return the readable files of a recording: files with recorded contents, or with `trust` any file.

    `directory` is the start of relative paths, by default the recorded directory.
    """
    hashes = None if trust else frozenset(recording.files().values())
    return Files(directory or recording.directory(), hashes)


def _of(name: str, found: Iterable[str]) -> Iterator[str]:
    return (f"{what} (participant '{safe_text(name)}')" for what in found)


def _check_kind(recording: Recording, planned: PlannedParticipant, kind: str) -> None:
    """Raise RecordingError if the plan has a participant with another kind, or with a role of another kind.

    A device planned as an engine would be opened.
    """
    if planned.kind != kind:
        raise RecordingError(
            f"'{recording.file}': participant '{safe_text(planned.name)}' is of kind"
            f" '{safe_text(planned.kind)}' in its plan and of kind '{safe_text(kind)}' in its scenario"
        )
    role = registry.find(kind).role
    if role != planned.role:
        raise RecordingError(
            f"'{recording.file}': its plan has participant '{safe_text(planned.name)}' as {planned.role}, but"
            f" kind '{kind}' is one of a {role}"
        )


def _unseen_demands(kind: str, params: Mapping[str, Any], directory: Path) -> Iterator[str]:
    """Yield demands refused unseen: a look at a class imports it, a look at a network path signs on there."""
    if names_class(kind):
        yield f"the class '{safe_text(kind)}', which no installed package has as a kind"
    for text in (str(directory), *_all_texts(params)):
        if text.startswith(("\\\\", "//")):
            yield f"the network path '{safe_text(text)}'"


def _installed_demands(kind: str, params: Mapping[str, Any], files: Files) -> Iterator[str]:
    """Yield the native code of a participant of an installed kind, and the files with changed contents."""
    model = registry.load(kind).params_model
    code = {str(params[name]) for name in model.native_code if params.get(name) is not None}
    for path in sorted(code | parameter_paths(model, params)):
        shown = safe_text(str(files.directory / path))
        if path in code:
            yield f"native code in '{shown}'"
        elif not files.allows(Path(path)):
            yield f"the file '{shown}', which is missing or has other contents than those recorded"


def _log_other_files(kind: str, params: Mapping[str, Any], directory: Path, recorded: set[str]) -> None:
    for path in sorted(parameter_paths(registry.load(kind).params_model, params)):
        if not has_contents(directory / path, recorded):
            log.warning(
                "file '%s' has changed or is missing since the recording: expect differences",
                directory / path,
            )


def _all_texts(value: Any) -> Iterator[str]:
    """Yield every text in a parameter."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for part in cast("dict[str, Any]", value).values():
            yield from _all_texts(part)
    elif isinstance(value, list):
        for part in cast("list[Any]", value):
            yield from _all_texts(part)
