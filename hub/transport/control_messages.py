"""Requests and replies of the control queryables: `std_msgs/String` messages with JSON."""

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
    """The reply to a refused request."""

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
    """A host process joins (first request), and reports all participants as configured (second)."""

    host: Annotated[str, Field(pattern=r"^(remote/)?[A-Za-z][A-Za-z0-9_]*$")]
    pid: int
    ready: bool = False
    watching: bool = False
    """Whether the host's observers have seen the state at time 0."""
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
    """Description of a session, for pages on the hub's machine."""

    session: str
    run: int
    scenario: Scenario
    plan: Plan
    recording: str = ""
    """Directory of the recording; empty without a recording."""
    tuned: dict[str, float] = {}
    """Present value of each changed tunable parameter, by `participant.port`."""


class JoinReply(_Json):
    """The data for a host to create the host's participants."""

    session: str
    run: int
    admission: int
    """The number of this admission.

    A device's samples carry the number: samples of an earlier host are recognised.
    """
    plan: Plan
    """The plan of the session; for a remote machine, only the part about the host."""
    params: dict[str, dict[str, Any]]
    directory: str
    watched: list[tuple[str, str]]
    """Outputs, as participant and port, with every value needed by the hub: for a recording or a measure."""
    ack_key: str
    """Key of the signatures of the host's acks, in hexadecimal digits."""
    programs_endpoint: str = ""
    """Endpoint shared by devices on the hub's machine and programs outside Trocar; empty on remote machines.
    """
    profile: bool = False
    """Whether the host keeps a profile, collected by the hub."""
    renewals: list[Renewal] = []
    """Steps at which participants change parameters."""
    live_from_ns: int = 0
    """Simulated time until which the run repeats a recorded run."""
