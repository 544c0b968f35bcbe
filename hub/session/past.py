"""The recorded part of a run: simulated again; a fork goes on from the end of this part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hub.planning.session_parameters import SessionParameters
from schemas.trocar_msgs import GrantMessage

__all__ = ["Past"]


@dataclass(frozen=True)
class Past:
    """The recorded part of a run."""

    grants: Iterator[GrantMessage]
    """Recorded grants, given again in place of samples of devices."""
    parameters: SessionParameters
    """Parameters of the run, made by the trust check of the recording."""
    live_from: int | None = None
    """First live step of the run; None: the run ends with the grants."""
    new_devices: frozenset[str] = frozenset()
    """Devices that are new or changed since the recording: inputs led by them are stale until they speak."""
