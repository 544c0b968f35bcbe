"""The connection of a process to a run of a session."""

from __future__ import annotations

from dataclasses import dataclass

import zenoh

from hub.planning.plan import Plan, PlannedParticipant
from hub.transport.control_messages import JoinReply
from hub.transport.refusals import Refusals
from schemas.codec import encode
from schemas.keys import Keys
from schemas.ros import StringMessage

__all__ = ["RunConnection"]


@dataclass(frozen=True)
class RunConnection:
    """The connection of a process to a run of a session."""

    session: zenoh.Session
    """The Zenoh session."""
    keys: Keys
    """The keys of the session."""
    plan: Plan
    """The plan of the session, or the part for this host."""
    number: int
    """Tells messages of this run from messages of any other."""
    refusals: Refusals
    """Counts the messages refused by this process."""
    admission: int = 0
    """The hub's number for this host since it joined; 0 in the hub's own process."""
    live_from_ns: int = 0
    """Simulated time before which the run repeats a recording: devices receive nothing of the repetition."""

    @classmethod
    def of_host(cls, session: zenoh.Session, reply: JoinReply, planned: PlannedParticipant) -> RunConnection:
        """Return the connection of a host that has joined; the hub counts refusals for participant `planned`.

        Args:
            session: The Zenoh session with the hub.
            reply: The hub's reply to the host.
            planned: A participant of the host.
        """
        keys = Keys(reply.session)
        refused = session.declare_publisher(
            keys.dropped_messages(planned.key_role, planned.name), encoding=zenoh.Encoding.APPLICATION_CDR
        )
        refusals = Refusals(report=lambda key: refused.put(encode(StringMessage(data=key))))
        return cls(session, keys, reply.plan, reply.run, refusals, reply.admission, reply.live_from_ns)
