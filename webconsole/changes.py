"""Changes of a scenario from a page: a value for each path of a form, and nothing else.

Kinds, hosts, endpoints, files and words of any sort are the command line's alone.
"""

from __future__ import annotations

from collections.abc import Mapping

from hub.planning.limits import safe_text
from schemas.errors import MessageError, ScenarioError, did_you_mean
from schemas.scenario import Scenario
from webconsole.fields import Scalar, override_text, participant_fields, session_fields

__all__ = ["overrides", "wrong_fields"]


def overrides(scenario: Scenario, changes: Mapping[str, Scalar]) -> list[str]:
    """Return changes as `path=value` of the command line.

    Raises MessageError if a page may not change a value, ScenarioError with a line for each value of a wrong
    type.
    """
    fields = {field.path: field for field in session_fields()}
    for name in {path.partition(".")[0] for path in changes} & scenario.participants.keys():
        fields |= {field.path: field for field in participant_fields(name, scenario.participants[name].kind)}
    made, wrong = list[str](), list[str]()
    for path, value in changes.items():
        if path not in fields:
            raise MessageError(
                f"'{safe_text(path)}' cannot be changed from a page, which changes numbers, switches and"
                f" choices of kinds that allow it; use the command line.{did_you_mean(path, fields)}"
            )
        try:
            made.append(fields[path].override(value))
        except ScenarioError as error:
            wrong.append(str(error))
    if wrong:
        raise ScenarioError("\n".join(wrong))
    return made


def wrong_fields(error: ScenarioError, changes: Mapping[str, Scalar]) -> dict[str, str]:
    """Return the messages of an error by the path of the field."""
    found: dict[str, list[str]] = {}
    lines = str(error).splitlines()
    for path, value in changes.items():
        place = f"--set {safe_text(override_text(path, value))}: "
        for line in lines:
            if line.startswith(place):
                message = line.removeprefix(place)
                found.setdefault(path, []).append(message.partition(": ")[2] or message)
    return {path: "; ".join(messages) for path, messages in found.items()}
