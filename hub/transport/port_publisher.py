"""Publishes the values of an output port: to hosts of this machine, and on Zenoh."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import zenoh

from hub.planning.plan import PlannedParticipant
from hub.transport.bundle import Bundle
from hub.transport.envelope import Tag
from hub.transport.local_values import LocalSender
from hub.transport.page_feed import PageFeed
from hub.transport.port_codec import PortCodec
from hub.transport.publisher import Publisher
from hub.transport.run_connection import RunConnection

__all__ = ["PortPublisher"]


class PortPublisher:
    """Publishes the values of an output port.

    Wall-time devices receive events under a key of their own, and signals in bundles. A step without events
    is published only for readers in need of every value (`always`): dozens of quiet ports cost nothing.

    Args:
        run: The connection to the run.
        planned: The participant.
        codec: Codec of the output.
        changed: Is called whenever `needed` may have changed.
        local: Senders to the reading hosts of this machine.
        always: A reader on Zenoh needs every value from the first on.
        feeds: Wall-time devices receive the events of the port.
        bundles: Bundles of the signal to wall-time devices and observers, with the signal's index in each.
        stride_ns: The simulated time between two values.
    """

    def __init__(
        self,
        run: RunConnection,
        planned: PlannedParticipant,
        codec: PortCodec,
        changed: Callable[[], None],
        local: Sequence[LocalSender] = (),
        *,
        always: bool,
        feeds: bool,
        bundles: Sequence[tuple[Bundle, int]] = (),
        stride_ns: int = 0,
    ) -> None:
        self.codec, port = codec, codec.port
        session, keys, self._run = run.session, run.keys, run.number
        self._changed = changed
        self._local = local
        self._bundles = bundles
        self._stride_ns = stride_ns
        block = zenoh.CongestionControl.BLOCK
        self._publishers: list[Publisher] = []
        key = keys.output(planned.key_role, planned.name, port.name)
        self._publishers.append(Publisher(session, key, block, self._update, always=always))
        self._every = [*local, *(self._publishers if always else ())]
        """Takers in need of every value, who learn of steps without events too."""
        if feeds:
            key = keys.feed(planned.name, port.name)
            self._publishers.append(Publisher(session, key, block, self._update, always=False))
        self._pages = PageFeed(session, keys.view(planned.name, port.name), self.codec, self._run, changed)
        self._update()

    def _update(self) -> None:
        self._needed = [publisher for publisher in self._publishers if publisher.needed]
        self._takers = [*self._local, *self._needed]
        self._changed()

    @property
    def always(self) -> bool:
        """Whether a reader needs every value, and to know of steps without events."""
        return bool(self._every)

    @property
    def needed(self) -> bool:
        """Whether anybody receives the values."""
        bundled = any(bundle.needs(index) for bundle, index in self._bundles)
        return bool(self._takers or bundled or self._pages.needed)

    def look(self) -> None:
        """Look for readers on Zenoh now, so that the first events reach all that are there."""
        for publisher in self._publishers:
            publisher.look()

    def keep_first(self, value: Any) -> None:
        """Keep the value at time 0 for later pages, if later values may lack something."""
        self._pages.keep_first(0, value)

    def put(self, step: int, time_ns: int, value: Any, *, again: bool = False) -> None:
        """Publish the value computed in `step`, valid at `time_ns`.

        `again`: once more, for readers on Zenoh that were not there before.
        """
        if self._bundles:
            self._send_bundle(time_ns, value)
        if self._pages.needed:
            self._pages.put(step, time_ns, value)
        takers = self._needed if again else self._takers
        if not takers:
            return
        if not self.codec.is_event:
            payload, tag = self.codec.encode(value, time_ns), Tag.pack(self._run, 0, step, time_ns)
            for taker in takers:
                taker.put(payload, tag)
            return
        if not value:
            tag = Tag.pack(self._run, 0, step, time_ns, 0, 0)
            for taker in takers:
                if taker in self._every:
                    taker.put(b"", tag)
        for index, message in enumerate(value):
            payload = self.codec.encode(message, time_ns)
            tag = Tag.pack(self._run, 0, step, time_ns, index, len(value))
            for taker in takers:
                taker.put(payload, tag)

    def _send_bundle(self, time_ns: int, value: Any) -> None:
        takers = [
            (bundle, index)
            for bundle, index in self._bundles
            if bundle.needs(index) and bundle.takes(time_ns, self._stride_ns)
        ]
        if takers:
            packed = self.codec.pack(value)
            for bundle, index in takers:
                bundle.add(index, packed)

    def close(self) -> None:
        """Stop publishing."""
        for publisher in self._publishers:
            publisher.close()
        self._pages.close()
