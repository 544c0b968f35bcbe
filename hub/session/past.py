"""The part of a run that a recording has: it is simulated again, and a fork goes on from its end."""

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
    """They are given again, instead of what devices say."""
    parameters: SessionParameters
    """Those of the run, which the trust check of the recording has made."""
    live_from: int | None = None
    """The step from which on the run is live; None: it ends with the grants."""
    new_devices: frozenset[str] = frozenset()
    """Those that are not in the recording as they are: what they lead is stale until they speak."""
