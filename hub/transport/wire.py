"""A host's connections to further processes, over Zenoh."""

from __future__ import annotations

from collections.abc import Sequence

import zenoh

from hub.planning.plan import PlannedParticipant
from hub.transport.bundle import Bundle, DeviceBundle, ObserverBundle
from hub.transport.cells import RemoteCell
from hub.transport.port_codec import PortCodec
from hub.transport.port_publisher import PortPublisher
from hub.transport.port_receiver import PortReceiver
from hub.transport.refusals import Refusals
from schemas.keys import Keys
from schemas.ports import Port

__all__ = ["Wire"]


class Wire:
    """A host's publishers and receivers on a Zenoh session.

    Args:
        session: The Zenoh session.
        keys: The keys of the session.
        run: The number of the run.
        refusals: Counts the refused messages.
        watched: The outputs with every value needed by the hub.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        run: int,
        refusals: Refusals,
        *,
        watched: Sequence[tuple[str, str]] = (),
    ) -> None:
        self._watched = set(watched)
        self.session = session
        self.keys = keys
        self.run = run
        self.refusals = refusals
        self._publishers: list[PortPublisher] = []
        self._bundles: list[Bundle] = []
        self._receivers: list[PortReceiver] = []
        self._cells: list[RemoteCell] = []
        self.changes = 0
        """How often somebody has begun or ceased to receive an output."""
        self.noted = 0
        """Part of `changes` noted by the host before the present step."""

    def _count_change(self) -> None:
        self.changes += 1

    def bundle(self, source: str, target: PlannedParticipant, step_ns: int, count: int) -> Bundle:
        """Return the bundle of `count` signals of a participant for a wall-time device or an observer."""
        key, changed = self.keys.signals(source, target.name), self._count_change
        bundle = (
            ObserverBundle(self.session, key, changed, target.period * step_ns)
            if target.observer
            else DeviceBundle(
                self.session,
                key,
                changed,
                use_ns=target.use_ns,
                uses_key=self.keys.uses(target.name, source),
                count=count,
                run=self.run,
                refusals=self.refusals,
            )
        )
        self._bundles.append(bundle)
        return bundle

    def publisher(
        self,
        planned: PlannedParticipant,
        codec: PortCodec,
        *,
        is_read: bool,
        feeds: bool,
        bundles: Sequence[tuple[Bundle, int]],
        stride_ns: int,
    ) -> PortPublisher:
        """Return a publisher of an output of a participant here; remote hosts read the output if `is_read`.

        Wall-time devices receive the events if `feeds`; wall-time devices and observers receive the signal
        in `bundles`, each with the signal's index. `stride_ns` is the simulated time between two values.
        """
        publisher = PortPublisher(
            self.session,
            self.keys,
            planned,
            codec,
            self.run,
            self._count_change,
            always=is_read or (planned.name, codec.port.name) in self._watched,
            feeds=feeds,
            bundles=bundles,
            stride_ns=stride_ns,
        )
        self._publishers.append(publisher)
        return publisher

    def cell(self, planned: PlannedParticipant, port: Port, stride: int, depth: int) -> RemoteCell:
        """Return the cell of an output of a participant in another process."""
        key = self.keys.output(planned.key_role, planned.name, port.name)
        receiver = PortReceiver(self.session, key, port, self.run, self.refusals)
        self._receivers.append(receiver)
        cell = RemoteCell(planned.period, stride, depth, receiver)
        self._cells.append(cell)
        return cell

    def has_initial_values(self) -> bool:
        """Return whether the initial value of every remote cell has arrived."""
        return all(cell.has_initial_value() for cell in self._cells)

    def close(self) -> None:
        """Stop publishing and receiving; the session stays open."""
        for entity in (*self._publishers, *self._bundles, *self._receivers):
            entity.close()
        self._publishers, self._bundles, self._receivers = [], [], []
