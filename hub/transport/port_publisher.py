"""Publishes the values of an output port on Zenoh and on fast lanes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import zenoh

from hub.planning.plan import PlannedParticipant
from hub.transport.bundle import Bundle
from hub.transport.envelope import Tag
from hub.transport.lane import LaneSender
from hub.transport.port_codec import PortCodec
from hub.transport.publisher import Publisher
from schemas.codec import encode
from schemas.keys import Keys
from schemas.ports import Port

__all__ = ["PortPublisher"]


class PortPublisher:
    """Publishes the values of one output port; without a reader it costs a flag test.

    Devices of the wall clock hear events under a key of their own, and signals in bundles. A step without
    events is told only to those who need every value (`always`): dozens of quiet ports cost nothing.
    """

    def __init__(
        self,
        session: zenoh.Session,
        keys: Keys,
        planned: PlannedParticipant,
        port: Port,
        run: int,
        *,
        always: bool,
        feeds: bool,
        bundles: Sequence[tuple[Bundle, int]] = (),
        lanes: Sequence[LaneSender] = (),
    ) -> None:
        """`always`: somebody needs every value from the first on; `feeds`: a device of the wall clock takes
        its events; `bundles`: for its signals.
        """
        self.codec = PortCodec(port)
        self._lanes = lanes
        self._run = run
        self._always = always
        self._bundles = bundles
        block = zenoh.CongestionControl.BLOCK
        self._ways: list[Publisher] = []
        self._ways.append(
            Publisher(
                session,
                keys.output(planned.key_role, planned.name, port.name),
                block,
                self._look,
                always=always,
            )
        )
        if feeds:
            self._ways.append(
                Publisher(session, keys.feed(planned.name, port.name), block, self._look, always=False)
            )
        self._look()

    def _look(self) -> None:
        self._wanted = [way for way in self._ways if way.wanted]

    def put(self, step: int, time_ns: int, value: Any) -> None:
        """Publish the value computed in `step`, valid at `time_ns`."""
        for lane in self._lanes:
            lane.send(step, value)
        bundles = [bundle for bundle in self._bundles if bundle[0].wanted] if self._bundles else ()
        if not self._wanted and not bundles:
            return
        if not self.codec.is_event:
            payload = self.codec.encode(value, time_ns)
            for bundle, index in bundles:
                bundle.add(index, payload)
            if self._wanted:
                self._send(payload, Tag.pack(self._run, 0, step, time_ns))
            return
        if not value and self._always:
            self._ways[0].put(b"", Tag.pack(self._run, 0, step, time_ns, 0, 0))
        for index, message in enumerate(value):
            self._send(encode(message), Tag.pack(self._run, 0, step, time_ns, index, len(value)))

    def _send(self, payload: bytes, tag: bytes) -> None:
        for way in self._wanted:
            way.put(payload, tag)

    def close(self) -> None:
        """Stop publishing."""
        for lane in self._lanes:
            lane.close()
        for way in self._ways:
            way.close()
