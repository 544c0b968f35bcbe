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
from hub.planning.plan import PlannedParticipant
from hub.recording.file_hashes import unrecorded_files
from hub.recording.recording import Recording
from schemas.errors import RecordingError, TrustError

__all__ = ["require_trust"]

log = logging.getLogger(__name__)


def require_trust(
    recording: Recording, participants: Mapping[str, PlannedParticipant], directory: Path, *, trust: bool
) -> None:
    """Check what these participants of a recording ask for, before one of them is made.

    Args:
        recording: The recording; its plan and its scenario need not fit together.
        participants: Those of its plan that are to be made, by name.
        directory: Where relative paths start.
        trust: Allow classes that are not installed, native code and files with other contents. A file with
            other contents is then logged.

    Raises TrustError with the list of what they ask for, RecordingError if plan and scenario contradict each
    other or the installed kinds, and ScenarioError if parameters are invalid.
    """
    scenario, recorded = recording.scenario(), set(recording.files().values())
    asked: list[str] = []
    for name, planned in participants.items():
        if name not in scenario.participants:
            raise RecordingError(f"'{recording.file}': its plan has a participant that its scenario lacks")
        params = scenario.participants[name].params
        if trust or not (found := list(_asked_unread(planned.kind, params, directory))):
            found = _asked(recording, name, planned, params, directory, recorded, trust=trust)
        asked += [f"{what} (participant '{shown(name)}')" for what in found]
    if asked and not trust:
        more = f"; and {len(asked) - MAX_PROBLEMS} more" if len(asked) > MAX_PROBLEMS else ""
        raise TrustError(
            f"'{recording.file}' asks for more than installed kinds and the files it was recorded with:"
            f" {'; '.join(asked[:MAX_PROBLEMS])}{more}. Code runs with all your rights. If you trust"
            " this recording, allow it with --trust (in Python: trust=True)."
        )


def _asked_unread(kind: str, params: Mapping[str, Any], directory: Path) -> Iterator[str]:
    """Yield what is asked for as far as it must be known before the parameters are validated."""
    if names_class(kind):
        yield f"the class '{shown(kind)}', which no installed package has as a kind"
    for text in (str(directory), *_texts(params)):
        if text.startswith(("\\\\", "//")):  # to look at such a path signs in to the machine that it names
            yield f"the network path '{shown(text)}'"


def _asked(
    recording: Recording,
    name: str,
    planned: PlannedParticipant,
    params: Mapping[str, Any],
    directory: Path,
    recorded: set[str],
    *,
    trust: bool,
) -> list[str]:
    """Return what the validated parameters of a participant ask for."""
    role = registry.find(planned.kind).role
    if role != planned.role:
        raise RecordingError(
            f"'{recording.file}': its plan has participant '{shown(name)}' as {planned.role}, but kind"
            f" '{planned.kind}' is one of a {role}"
        )
    validated = registry.validated(planned.kind, name, params, directory)
    code = {
        str(directory / path)
        for parameter in validated.native_code
        if (path := getattr(validated, parameter)) is not None
    }
    files = unrecorded_files(validated, directory, recorded)
    if trust:
        for file in files:
            log.warning("file '%s' has changed or is missing since the recording: expect differences", file)
    return [
        *(f"native code in '{shown(path)}'" for path in sorted(code)),
        *(
            f"the file '{shown(file)}', which is missing or has other contents than those recorded"
            for file in files
            if file not in code
        ),
    ]


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
