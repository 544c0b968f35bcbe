"""Where a fork comes from: its parent, the instant, and what was changed there."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from hub.planning.renewal import Renewal
from hub.recording.recording import Recording
from schemas.errors import RecordingError

__all__ = ["ATTACHMENT", "ForkOrigin", "fork_origin"]

ATTACHMENT = "fork.json"


class ForkOrigin(BaseModel):
    """What the recording of a fork says of its origin.

    Up to `step` it holds the grants of the parent once more, so it is complete in itself.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    parent: str
    """The parent's recording, as it was named."""
    parent_run: str
    """The parent's number of the run, in hexadecimal digits, which its grants hold."""
    step: int = Field(gt=0)
    time_ns: int = Field(gt=0)
    """Simulated time from which on it is another session."""
    changes: tuple[str, ...] = ()
    """`a.b.c=value`, as they were given."""
    renewals: tuple[Renewal, ...] = ()
    """Of the whole session, those of its ancestors included."""


def fork_origin(recording: Recording) -> ForkOrigin | None:
    """Return where a recorded session was forked; None if it was not.

    Raises RecordingError if what is recorded of it cannot be read.
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
