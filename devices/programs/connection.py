"""The connection of a program to the gateway of a session: topics by name, and the end of the session."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from time import monotonic
from typing import Generic, TypeVar

import zenoh
from zenoh.handlers import Callback

from devices.ros.topics.row import Row
from devices.ros.transport import NODE, Publisher
from devices.ros.zenoh.layout import GraphToken, graph_key, ready_key
from devices.ros.zenoh.transport import ZenohTransport
from schemas.codec import decode, encode
from schemas.errors import ConnectError, SessionError, did_you_mean
from schemas.message import Message

__all__ = ["Connection", "Topic", "find_gateway"]

M = TypeVar("M", bound=Message)

_POLL_S = 0.05
"""Period of looks at the clock while waiting; Ctrl-C works in between, on Windows too."""
_ANSWER_S = 5.0
"""Longest wait for the first message of a topic, and for the gateway's subscription."""
_MAX_AGE_S = 1.0
"""Age of the oldest state in use, as of a CRTK client; the gateway publishes no older state either."""


def find_gateway(session: zenoh.Session, domain: int) -> list[GraphToken]:
    """Return the tokens of a gateway in `domain`; empty: no gateway, or not all tokens are here yet."""
    for ready in session.liveliness().get(ready_key(domain), timeout=_ANSWER_S):
        if ready.ok is None:
            continue
        *_, gateway, count = str(ready.ok.key_expr).split("/")
        replies = session.liveliness().get(graph_key(domain), timeout=_ANSWER_S)
        tokens = [
            token
            for reply in replies
            if reply.ok is not None
            and (token := GraphToken.parse_token(str(reply.ok.key_expr))) is not None
            and token.session == gateway
        ]
        if sum(token.kind != "NN" for token in tokens) == int(count):
            return tokens
    return []


class Connection:
    """A program's connection to one gateway. Messages arrive in Zenoh's threads."""

    def __init__(
        self,
        session: zenoh.Session,
        label: str,
        node: str,
        domain: int,
        tokens: list[GraphToken],
        start_s: float,
    ) -> None:
        """Join the graph.

        Args:
            session: Zenoh session with the router of the gateway; closed by `close`.
            label: the session for error messages.
            node: name of this program in the graph, with a leading slash.
            domain: the ROS domain.
            tokens: tokens of the gateway.
            start_s: longest wait for the session to start.
        """
        self.label, self.node, self.start_s = label, node, start_s
        self.published: Mapping[str, str] = _types(tokens, "MP")
        """Types of the published topics, by name."""
        self.commands: Mapping[str, str] = _types(tokens, "MS")
        """Types of the commands, by name."""
        self._changed = threading.Condition()
        self._ended = False
        self._closed = False
        self._senders: dict[str, Publisher] = {}
        self._transport = ZenohTransport(
            lambda: session, domain, node=node, congestion=zenoh.CongestionControl.BLOCK
        )
        self._transport.changed = self.notify
        gateway = GraphToken(tokens[0].session, 0, "NN", NODE).key(domain)
        self._watch = session.liveliness().declare_subscriber(
            gateway, Callback(self._gateway_changed, indirect=False), history=True
        )

    def listen(self, topic: str, receive: Callable[[bytes], None], *, latched: bool = False) -> None:
        """Call `receive` with every message (CDR) on `topic`; with the last message at once, if `latched`."""
        self._check_open()
        row = Row(topic, self.type_of(topic, self.published), "publish", latched=latched)

        def on_message(payload: bytes, client: str, /, *, connected_ns: int = 0) -> None:  # noqa: ARG001
            receive(payload)
            self.notify()

        self._transport.subscribe(row, on_message)

    def send(self, topic: str, message: Message) -> None:
        """Publish a command. Raises SessionError after the end of the session."""
        self._check_open()
        publish = self._senders.get(topic)
        if publish is None:
            row = Row(topic, self.type_of(topic, self.commands), "subscribe")
            publish = self._senders[topic] = self._transport.advertise(row)
            if not self.wait_for(lambda: publish.wanted, _ANSWER_S):
                raise ConnectError(f"{self.label} does not receive {topic} within {_ANSWER_S:g} s")
        publish(encode(message))

    def wait_for(self, holds: Callable[[], bool], timeout_s: float | None) -> bool:
        """Wait until `holds` or for `timeout_s`; return whether it holds.

        Raises SessionError if the session ends meanwhile.
        """
        deadline = None if timeout_s is None else monotonic() + timeout_s
        with self._changed:
            while not holds():
                self._check_open()
                if deadline is not None and monotonic() > deadline:
                    return False
                self._changed.wait(_POLL_S)
        return True

    def notify(self) -> None:
        """Let waiting calls look again."""
        with self._changed:
            self._changed.notify_all()

    def close(self) -> None:
        """Leave the graph."""
        if not self._closed:
            self._closed = True
            self._watch.undeclare()
            self._transport.close()

    def type_of(self, topic: str, known: Mapping[str, str]) -> str:
        """Return the type of `topic`. Raises ConnectError for a topic that is not among `known`."""
        if topic not in known:
            raise ConnectError(f"{self.label} has no {topic}.{did_you_mean(topic, known)}")
        return known[topic]

    def _check_open(self) -> None:
        if self._closed:
            raise ConnectError(f"the connection to {self.label} is closed")
        if self._ended:
            raise SessionError(f"{self.label} has ended")

    def _gateway_changed(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.DELETE:
            self._ended = True
            self.notify()


class Topic(Generic[M]):
    """The newest message of a published topic."""

    def __init__(self, connection: Connection, name: str, model: type[M], *, latched: bool = False) -> None:
        self._connection, self._name, self._model, self._latched = connection, name, model, latched
        self._newest: tuple[bytes, float] | None = None
        connection.listen(name, self._receive, latched=latched)

    def newest(self, timeout_s: float = _ANSWER_S) -> M:
        """Return the newest message, at most a second old unless latched; wait for one if there is none.

        Raises ConnectError after `timeout_s`, SessionError if the session ends.
        """
        if not self._connection.wait_for(self._is_fresh, timeout_s) or self._newest is None:
            raise ConnectError(
                f"no message on {self._name} within {timeout_s:g} s: {self._connection.label} is paused, or"
                " its scenario connects nothing to it"
            )
        return decode(self._model, self._newest[0])

    def _is_fresh(self) -> bool:
        newest = self._newest
        return newest is not None and (self._latched or monotonic() - newest[1] < _MAX_AGE_S)

    def _receive(self, payload: bytes) -> None:
        self._newest = payload, monotonic()


def _types(tokens: list[GraphToken], kind: str) -> dict[str, str]:
    """Return the ROS types of all topics with tokens of `kind`, by name."""
    return {
        token.topic: _ros_type(token.type)
        for token in sorted(tokens, key=lambda t: t.topic)
        if token.kind == kind
    }


def _ros_type(dds_name: str) -> str:
    """`sensor_msgs::msg::dds_::JointState_` to `sensor_msgs/msg/JointState`."""
    package, group, _, name = dds_name.split("::")
    return f"{package}/{group}/{name.removesuffix('_')}"
