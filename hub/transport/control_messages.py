"""Requests and replies of the control queryables: `std_msgs/String` messages that hold JSON."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from hub.planning.plan import Plan
from hub.planning.renewal import Renewal
from schemas.ports import BondSide
from schemas.scenario import Scenario

__all__ = [
    "ClockReply",
    "DescribeReply",
    "Empty",
    "JoinReply",
    "JoinRequest",
    "Refusal",
    "SetRequest",
    "StepRequest",
]


class _Json(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Empty(_Json):
    """A request or a reply without content."""


class Refusal(_Json):
    """The reply to a request that is refused."""

    refused: str


class StepRequest(_Json):
    """Take this many steps, then pause."""

    steps: int = Field(default=1, ge=1)


class SetRequest(_Json):
    """Write `value` to an input without a connection: numbers for a vector, else the message as JSON."""

    participant: str
    port: str
    value: Any


class JoinRequest(_Json):
    """A host process joins (first request), and reports that its participants are configured (second)."""

    host: Annotated[str, Field(pattern=r"^(remote/)?[A-Za-z][A-Za-z0-9_]*$")]
    pid: int
    ready: bool = False
    watching: bool = False
    """Its observers have seen the state at time 0."""
    bonds: dict[str, tuple[BondSide, ...]] = {}
    failed: str = ""
    """Why the host has failed: `participant: cause`."""
    ended: str = ""
    """Why a participant of the host ends the session: `participant: reason`."""

    @property
    def is_local(self) -> bool:
        """Whether the hub itself has started the host."""
        return not self.host.startswith("remote/")


class ClockReply(_Json):
    """The time by the hub's monotonic clock: when the request arrived, and when the reply was sent."""

    received_ns: int
    replied_ns: int


class DescribeReply(_Json):
    """What a session is: for pages on the hub's machine."""

    session: str
    run: int
    scenario: Scenario
    plan: Plan
    recording: str = ""
    """The directory to which it is recorded; empty: it is not."""


class JoinReply(_Json):
    """All that a host needs to create its participants."""

    session: str
    run: int
    admission: int
    """The number of this admission.

    A device's samples carry it, so that those of an earlier host are recognised.
    """
    plan: Plan
    """For another machine, the part of it that concerns the host."""
    params: dict[str, dict[str, Any]]
    directory: str
    watched: list[tuple[str, str]]
    """Outputs, as participant and port, of which the hub needs every value: for a recording or a measure."""
    ack_key: str
    """The key with which the host signs its acks, in hexadecimal digits."""
    programs_endpoint: str = ""
    """Where devices on the hub's machine meet programs outside Trocar; empty on other machines."""
    profile: bool = False
    """The host keeps a profile, for which the hub asks."""
    renewals: list[Renewal] = []
    """Where participants take other parameters."""
    live_from_ns: int = 0
    """Simulated time before which the run repeats a recorded one."""
