"""Where a page's values come from: a running session or a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from hub.participant import Params
from schemas.ports import Port
from schemas.scenario import Scenario

__all__ = ["Outlet", "Source", "Value"]


class Outlet(NamedTuple):
    """An output port of a participant."""

    participant: str
    port: Port
    live: bool = True
    """Whether the values can be seen while the session runs."""

    @property
    def name(self) -> str:
        """`participant.port`, as in a scenario."""
        return f"{self.participant}.{self.port.name}"


class Value(NamedTuple):
    """The newest message of a port."""

    time_ns: int
    """Simulated time of the value, ns."""
    payload: bytes
    """Message in CDR."""


class Source(Protocol):
    """Source of the pages of a server: a running session or a recording."""

    kind: str
    """`live` or `recording`."""
    generation: int
    """Count of the sessions shown: another session has different ports and a different scene."""

    @property
    def scenario(self) -> Scenario | None:
        """The scenario; None while there is no session."""
        ...

    def params(self, participant: str) -> Params:
        """Return the validated parameters of a participant.

        Raises TrocarError if the parameters are not valid, or not to be trusted.
        """
        ...

    @property
    def outlets(self) -> Sequence[Outlet]:
        """The output ports, by participant, in order of declaration."""
        ...

    @property
    def guided(self) -> str | None:
        """The participant guided by a person from a page; None without guidance, as in every recording."""
        ...

    @property
    def state(self) -> Mapping[str, Any]:
        """Contents of the page's head, ready for JSON: name, state, times, counts."""
        ...

    def want(self, names: frozenset[str]) -> None:
        """Receive from now on the values of these outlets, by name, and no others."""
        ...

    def newest(self, name: str, time_ns: int | None) -> Value | None:
        """Return the newest value of an outlet at a simulated time; None: now, as for every live session."""
        ...

    def first(self, name: str) -> Value | None:
        """Return the value of an outlet at the beginning; only there is the surface of an organ."""
        ...

    def close(self) -> None:
        """Receive nothing more."""
        ...
