"""What a recording may ask for: by itself, installed kinds and files with the recorded contents.

Anyone may have made a recording. Its scenario and its plan can name any class, library, FMU or file of this
machine, and to build a participant from them would run or read it.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

from hub.planning import registry
from hub.planning.foreign_code import names_class
from hub.planning.limits import MAX_PROBLEMS, shown
from hub.planning.parameter_paths import parameter_paths
from hub.planning.plan import PlannedParticipant
from hub.recording.file_hashes import has_contents
from hub.recording.recording import Recording
from schemas.errors import RecordingError, TrustError

__all__ = ["require_trust"]

log = logging.getLogger(__name__)


def require_trust(
    recording: Recording, participants: Mapping[str, PlannedParticipant], directory: Path, *, trust: bool
) -> None:
    """Check what these participants of a recording ask for, before anything of them is imported or read.

    Args:
        recording: The recording; its plan and its scenario need not fit together.
        participants: Those of its plan that are to be made, by name.
        directory: Where relative paths start.
        trust: Allow classes that are not installed, native code and files with other contents. A file with
            other contents is then logged.

    Raises TrustError with the list of what they ask for, RecordingError if plan and scenario contradict each
    other or the installed kinds, and ScenarioError if a kind cannot be loaded.
    """
    scenario, recorded = recording.scenario(), set(recording.files().values())
    asked: list[str] = []
    for name, planned in participants.items():
        if name not in scenario.participants:
            raise RecordingError(f"'{recording.file}': its scenario has no participant '{shown(name)}'")
        params = scenario.participants[name].params
        if trust:
            _check_role(recording, name, planned)
            _log_other_files(planned.kind, params, directory, recorded)
            continue
        found = list(_unseen(planned.kind, params, directory))
        if not found:
            _check_role(recording, name, planned)
            found = list(_asked(planned.kind, params, directory, recorded))
        asked += [f"{what} (participant '{shown(name)}')" for what in found]
    if asked:
        more = f"; and {len(asked) - MAX_PROBLEMS} more" if len(asked) > MAX_PROBLEMS else ""
        raise TrustError(
            f"'{recording.file}' asks for more than installed kinds and the files it was recorded with:"
            f" {'; '.join(asked[:MAX_PROBLEMS])}{more}. Code runs with all your rights. If you trust this"
            " recording, allow it with --trust (in Python: trust=True)."
        )


def _check_role(recording: Recording, name: str, planned: PlannedParticipant) -> None:
    """Raise RecordingError if the plan has a participant in a role that its kind has not.

    A device that is planned as an engine would be opened.
    """
    role = registry.find(planned.kind).role
    if role != planned.role:
        raise RecordingError(
            f"'{recording.file}': its plan has participant '{shown(name)}' as {planned.role}, but kind"
            f" '{planned.kind}' is one of a {role}"
        )


def _unseen(kind: str, params: Mapping[str, Any], directory: Path) -> Iterator[str]:
    """Yield what must not even be looked at: a class is imported, a network path signs in to its machine."""
    if names_class(kind):
        yield f"the class '{shown(kind)}', which no installed package has as a kind"
    for text in (str(directory), *_texts(params)):
        if text.startswith(("\\\\", "//")):
            yield f"the network path '{shown(text)}'"


def _asked(kind: str, params: Mapping[str, Any], directory: Path, recorded: set[str]) -> Iterator[str]:
    """Yield the native code of a participant of an installed kind, and its files with other contents."""
    model = registry.load(kind).params_model
    code = {str(params[name]) for name in model.native_code if params.get(name) is not None}
    for path in sorted(code | parameter_paths(model, params)):
        if path in code:
            yield f"native code in '{shown(str(directory / path))}'"
        elif not has_contents(directory / path, recorded):
            yield (
                f"the file '{shown(str(directory / path))}', which is missing or has other contents than"
                " those recorded"
            )


def _log_other_files(kind: str, params: Mapping[str, Any], directory: Path, recorded: set[str]) -> None:
    for path in sorted(parameter_paths(registry.load(kind).params_model, params)):
        if not has_contents(directory / path, recorded):
            log.warning(
                "file '%s' has changed or is missing since the recording: expect differences",
                directory / path,
            )


def _texts(value: Any) -> Iterator[str]:
    """Yield every text in a parameter."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for part in cast("dict[str, Any]", value).values():
            yield from _texts(part)
    elif isinstance(value, list):
        for part in cast("list[Any]", value):
            yield from _texts(part)
