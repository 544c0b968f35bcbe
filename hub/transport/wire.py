"""A host's connections to further processes: to hosts of this machine by sockets, to others over Zenoh."""

from __future__ import annotations

from collections.abc import Sequence

from hub.planning.plan import PlannedParticipant
from hub.transport.bundle import Bundle, DeviceBundle, ObserverBundle
from hub.transport.cells import RemoteCell
from hub.transport.local_values import LocalValues
from hub.transport.port_codec import PortCodec
from hub.transport.port_publisher import PortPublisher
from hub.transport.port_receiver import LocalReceiver, ZenohReceiver
from hub.transport.run_connection import RunConnection
from schemas.ports import Port

__all__ = ["Wire"]


class Wire:
    """A host's publishers and receivers in a run.

    Args:
        run: The connection to the run.
        local: The values from and to other hosts of this machine; None without any.
        watched: The outputs with every value needed by the hub.
    """

    def __init__(
        self, run: RunConnection, local: LocalValues | None = None, *, watched: Sequence[tuple[str, str]] = ()
    ) -> None:
        self._local = local
        self._watched = set(watched)
        self.run = run
        self._publishers: list[PortPublisher] = []
        self._bundles: list[Bundle] = []
        self._receivers: list[ZenohReceiver] = []
        self._cells: list[RemoteCell] = []
        self.changes = 0
        """How often somebody has begun or ceased to receive an output."""
        self.noted = 0
        """Part of `changes` noted by the host before the present step."""

    def _count_change(self) -> None:
        self.changes += 1

    def bundle(self, source: str, target: PlannedParticipant, step_ns: int, count: int) -> Bundle:
        """Return the bundle of `count` signals of a participant for a wall-time device or an observer."""
        session, keys, changed = self.run.session, self.run.keys, self._count_change
        key = keys.signals(source, target.name)
        bundle = (
            ObserverBundle(session, key, changed, target.period * step_ns)
            if target.observer
            else DeviceBundle(
                session,
                key,
                changed,
                use_ns=target.use_ns,
                uses_key=keys.uses(target.name, source),
                count=count,
                run=self.run.number,
                refusals=self.run.refusals,
            )
        )
        self._bundles.append(bundle)
        return bundle

    def publisher(
        self,
        planned: PlannedParticipant,
        codec: PortCodec,
        readers: Sequence[str],
        *,
        feeds: bool,
        bundles: Sequence[tuple[Bundle, int]],
        stride_ns: int,
    ) -> PortPublisher:
        """Return a publisher of an output of a participant here, read by the hosts `readers`.

        Wall-time devices receive the events if `feeds`; wall-time devices and observers receive the signal
        in `bundles`, each with the signal's index. `stride_ns` is the simulated time between two values.
        """
        name, local = codec.port.name, self._local
        senders = [None if local is None else local.sender(host, planned.name, name) for host in readers]
        publisher = PortPublisher(
            self.run,
            planned,
            codec,
            self._count_change,
            [sender for sender in senders if sender is not None],
            always=None in senders or (planned.name, name) in self._watched,
            feeds=feeds,
            bundles=bundles,
            stride_ns=stride_ns,
        )
        self._publishers.append(publisher)
        return publisher

    def cell(self, planned: PlannedParticipant, port: Port, stride: int, depth: int) -> RemoteCell:
        """Return the cell of an output of a participant in another process."""
        output = None if self._local is None else self._local.output(planned.name, port.name)
        if output is None:
            receiver = ZenohReceiver(self.run, planned, port)
            self._receivers.append(receiver)
        else:
            receiver = LocalReceiver(self.run, port, output)
        cell = RemoteCell(planned.period, stride, depth, receiver)
        self._cells.append(cell)
        return cell

    def has_initial_values(self) -> bool:
        """Return whether the initial value of every remote cell has arrived."""
        return all(cell.has_initial_value() for cell in self._cells)

    def flush(self) -> None:
        """Send the values for other hosts of this machine."""
        if self._local is not None:
            self._local.flush()

    def take_arrived(self) -> None:
        """Read the values of other hosts of this machine that have arrived, and make room for more."""
        if self._local is not None:
            self._local.take_arrived()

    def close(self) -> None:
        """Stop publishing and receiving; the session stays open."""
        for entity in (*self._publishers, *self._bundles, *self._receivers):
            entity.close()
        self._publishers, self._bundles, self._receivers = [], [], []
        if self._local is not None:
            self._local.close()
