"""Channels for a host's grants and acks: over Zenoh, or by a link for a host started by the hub."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import zenoh
from zenoh.handlers import FifoChannel

from hub.transport.envelope import signature
from hub.transport.host_link import HostLink
from hub.transport.run_connection import RunConnection
from schemas.errors import MessageError
from schemas.lockstep import Ack, Grant, pack_ack

__all__ = ["HubChannel", "LinkChannel", "ZenohChannel"]

CheckGrant = Callable[[bytes], Grant]
"""Returns the grant in a payload; raises MessageError unless this is the next grant of the run."""


class HubChannel(Protocol):
    """Receives the grants of a run, and sends the acks of a host's participants."""

    def grant(self, *, wait: bool) -> Grant | None:
        """Return the next grant; None if no grant has arrived. With `wait`, wait, or for a moment."""
        ...

    def acknowledge(self, name: str, ack: Ack) -> None:
        """Send the ack of a participant, at once or with `flush`."""
        ...

    def flush(self) -> None:
        """Send all unsent acks: the host has completed a grant."""
        ...


class ZenohChannel:
    """A channel over Zenoh, with an ack at once after each participant's last step, signed with `ack_key`.

    Invalid grants are refused and counted.
    """

    def __init__(self, run: RunConnection, names: Sequence[str], ack_key: bytes, check: CheckGrant) -> None:
        self._ack_key, self._refusals, self._check = ack_key, run.refusals, check
        self._acks = {
            name: run.session.declare_publisher(
                run.keys.ack(name),
                encoding=zenoh.Encoding.APPLICATION_CDR,
                congestion_control=zenoh.CongestionControl.BLOCK,
                priority=zenoh.Priority.REAL_TIME,
                express=True,
            )
            for name in names
        }
        self._grants = run.session.declare_subscriber(run.keys.grant, FifoChannel(256))

    def grant(self, *, wait: bool) -> Grant | None:
        """Return the grant in the next message; None without a message or a valid grant."""
        sample = self._grants.recv() if wait else self._grants.try_recv()
        if sample is None:
            return None
        try:
            return self._check(sample.payload.to_bytes())
        except MessageError as error:
            self._refusals.refuse_sample(sample, error)
            return None

    def acknowledge(self, name: str, ack: Ack) -> None:
        """Send an ack."""
        payload = pack_ack(ack)
        self._acks[name].put(payload, attachment=signature(payload, self._ack_key))

    def flush(self) -> None:
        """Everything has been sent."""


class LinkChannel:
    """A channel by the link to the hub, the parent of this host: all acks of a grant in a single message."""

    def __init__(self, link: HostLink, names: Sequence[str], check: CheckGrant) -> None:
        self._link, self._check = link, check
        self._places = {name: place for place, name in enumerate(names)}
        self._acks: list[tuple[int, bytes]] = []

    def grant(self, *, wait: bool) -> Grant | None:
        """Return the next grant; raises MessageError for any unexpected message."""
        payload = self._link.grant(wait=wait)
        return None if payload is None else self._check(payload)

    def acknowledge(self, name: str, ack: Ack) -> None:
        """Keep an ack until `flush`."""
        self._acks.append((self._places[name], pack_ack(ack)))

    def flush(self) -> None:
        """Send the acks, if there are any: the hub reads none of a host without a step."""
        if self._acks:
            self._link.send_acks(self._acks)
            self._acks.clear()
