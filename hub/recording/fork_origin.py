"""The origin of a fork: parent, instant and changes."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from hub.planning.renewal import Renewal
from hub.recording.recording import Recording
from schemas.errors import RecordingError

__all__ = ["ATTACHMENT", "ForkOrigin", "fork_origin"]

ATTACHMENT = "fork.json"


class ForkOrigin(BaseModel):
    """The origin of a fork, as stated in the recording.

    Up to `step` the recording repeats the grants of the parent, and so is complete in itself.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    parent: str
    """Path of the parent's recording, as given."""
    parent_run: str
    """Run number in the parent's grants, in hexadecimal digits."""
    step: int = Field(gt=0)
    time_ns: int = Field(gt=0)
    """Simulated time of the fork."""
    changes: tuple[str, ...] = ()
    """Overrides `a.b.c=value`, as given."""
    renewals: tuple[Renewal, ...] = ()
    """Renewals of the whole session, with the renewals of the ancestors."""


def fork_origin(recording: Recording) -> ForkOrigin | None:
    """Return the origin of a recorded session; None if the session is no fork.

    Raises RecordingError if the recorded origin cannot be read.
    """
    text = recording.attachments.get(ATTACHMENT)
    if text is None:
        return None
    try:
        return ForkOrigin.model_validate_json(text)
    except ValidationError as error:
        raise RecordingError(
            f"'{recording.file}': this version cannot read its {ATTACHMENT}:"
            f" {error.errors(include_url=False)[0]['msg']}"
        ) from error
