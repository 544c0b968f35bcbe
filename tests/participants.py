"""Participants as a scenario would make them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hub.participant import Device, Stepped
from hub.planning.session_parameters import SessionParameters
from schemas.files import Files

__all__ = ["make_participant"]


def make_participant(kind: str, name: str, params: Mapping[str, Any], directory: Path) -> Stepped | Device:
    """Return a participant with the parameters that a scenario in `directory` would state."""
    made, _ = SessionParameters({name: kind}, {name: params}, (), Files(directory)).make(name)
    return made
