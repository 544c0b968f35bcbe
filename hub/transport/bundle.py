"""Bundles: the signals of a participant for a wall-time device or an observer, all of a step in a message.

A gateway to ROS receives a hundred signals at a time. As a message each, the signals took the hub 1.9 ms of a
step (docs/decisions/0034). Vectors are bundled as numbers alone: both ends know the ports.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterator, Sequence

import zenoh
from zenoh.handlers import Callback

from hub.planning.plan import ConnectionToDevice, Plan
from hub.transport.envelope import Tag
from hub.transport.publisher import Publisher
from hub.transport.refusals import Refusals
from schemas.errors import MessageError

__all__ = ["Bundle", "DeviceBundle", "ObserverBundle", "bundled_connections", "unpack_bundle", "use_mask"]

_HEAD = struct.Struct("<II")
"""Index of the connection, and number of bytes of the value that follows."""
_WANTED, _UNUSED = b"\1", b"\0"


def bundled_connections(plan: Plan, source: str, target: str) -> list[ConnectionToDevice]:
    """Return the connections in a bundle (signals only), in the order of their indices."""
    return [
        outlet
        for outlet in plan.to_devices
        if (outlet.source, outlet.target) == (source, target)
        and plan.participants[source].port(outlet.source_port).variability == "signal"
    ]


def use_mask(ports: Sequence[str], unused: Collection[str]) -> bytes:
    """Return a device's message to the source of a bundle: a byte for each of the inputs `ports`."""
    return b"".join(_UNUSED if port in unused else _WANTED for port in ports)


class Bundle:
    """Collects the values of a step and publishes the bundle under `key`.

    A reader on a congested connection misses some values, and delays nobody. `changed` is called whenever
    `needs` may have changed.
    """

    def __init__(self, session: zenoh.Session, key: str, changed: Callable[[], None]) -> None:
        self._parts: list[bytes] = []
        self._changed = changed
        self._publisher = Publisher(session, key, zenoh.CongestionControl.DROP, self._matched, always=False)

    def needs(self, index: int) -> bool:  # noqa: ARG002
        """Return whether the reader subscribes, and needs the connection with this index."""
        return self._publisher.needed

    def takes(self, time_ns: int, stride_ns: int) -> bool:  # noqa: ARG002
        """Return whether to add the value of `time_ns`, which holds for `stride_ns`."""
        return self._publisher.needed

    def _matched(self) -> None:
        self._changed()

    @property
    def filled(self) -> bool:
        """Whether there is anything to send."""
        return bool(self._parts)

    def add(self, index: int, payload: bytes) -> None:
        """Add the value of the connection with this index, as returned by `PortCodec.pack`."""
        self._parts += _HEAD.pack(index, len(payload)), payload

    def send(self, tag: bytes, *, first: bool = False) -> None:  # noqa: ARG002
        """Publish what was added since the last time; `first`: the values at time 0."""
        self._publisher.put(b"".join(self._parts), tag)
        self._parts.clear()

    def close(self) -> None:
        """Publish no more."""
        self._publisher.close()


class DeviceBundle(Bundle):
    """A bundle of the values needed by a wall-time device: only the values in use, as often as used.

    Args:
        session: The Zenoh session.
        key: The key of the bundle.
        changed: Is called whenever `needs` may have changed.
        use_ns: The time between two uses of the values; 0: each value is used.
        uses_key: The key of the device's needs; until these are published, the device needs everything.
        count: The number of connections.
        run: The number of the run.
        refusals: Counts the refused messages.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        changed: Callable[[], None],
        *,
        use_ns: int,
        uses_key: str,
        count: int,
        run: int,
        refusals: Refusals,
    ) -> None:
        self._use_ns, self._run, self._refusals = use_ns, run, refusals
        self._wanted = _WANTED * count
        super().__init__(session, key, changed)
        self._subscriber = session.declare_subscriber(uses_key, Callback(self._set_wanted, indirect=False))

    def _set_wanted(self, sample: zenoh.Sample) -> None:
        try:
            tag, wanted = Tag.of(sample), sample.payload.to_bytes()
            if tag.run != self._run:
                raise MessageError(f"belongs to run {tag.run:x}, this is run {self._run:x}")
            if len(wanted) != len(self._wanted):
                raise MessageError(f"uses of {len(wanted)} connections, there are {len(self._wanted)}")
        except MessageError as error:
            self._refusals.refuse_sample(sample, error)
            return
        if wanted != self._wanted:
            self._wanted = wanted
            self._changed()

    def needs(self, index: int) -> bool:
        """Return whether the device subscribes, and needs the connection with this index."""
        return self._wanted[index] != 0 and self._publisher.needed

    def takes(self, time_ns: int, stride_ns: int) -> bool:
        """Return whether to add the value of `time_ns`, which holds for `stride_ns`.

        Every n-th value is added, with the largest n for a new value at each use.
        """
        if self._use_ns >= 2 * stride_ns and time_ns % (self._use_ns // stride_ns * stride_ns):
            return False
        return self._publisher.needed

    def close(self) -> None:
        """Publish no more."""
        self._subscriber.undeclare()
        super().close()


class ObserverBundle(Bundle):
    """A bundle of the values read by an observer at the observer's own period, and of no others.

    The values at time 0 may hold data missing in later values, such as the surface of a soft body: an
    observer joining again receives the values at time 0 before all others.
    """

    def __init__(self, session: zenoh.Session, key: str, changed: Callable[[], None], period_ns: int) -> None:
        self._period_ns = period_ns
        self._first: tuple[bytes, bytes] | None = None
        self._joins = False
        super().__init__(session, key, changed)

    def _matched(self) -> None:
        self._joins = True
        super()._matched()

    def takes(self, time_ns: int, stride_ns: int) -> bool:
        """Return whether to add the value of `time_ns`: it holds at a multiple of the period."""
        return self._publisher.needed and -time_ns % self._period_ns < stride_ns

    def send(self, tag: bytes, *, first: bool = False) -> None:
        """Publish what was added since the last time; `first`: the values at time 0."""
        if first:
            self._first = b"".join(self._parts), tag
        elif self._joins and self._first is not None:
            self._publisher.put(*self._first)
        self._joins = False
        super().send(tag)


def unpack_bundle(payload: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield index and bytes of each value in a bundle; raises MessageError if invalid."""
    at = 0
    while at < len(payload):
        if len(payload) - at < _HEAD.size:
            raise MessageError(f"a bundle of {len(payload)} bytes ends within a head")
        index, size = _HEAD.unpack_from(payload, at)
        at += _HEAD.size + size
        if at > len(payload):
            raise MessageError(f"a bundle of {len(payload)} bytes ends within a value of {size}")
        yield index, payload[at - size : at]
