"""The door to Foxglove: the SDK's server, reached through the page's server alone.

The SDK's server (0.30) lets any website of this machine's browsers connect, without a credential. So the
SDK's server listens on loopback with a certificate made anew each time, accepted by no browser, and the
page's server relays clients with the secret link. The SDK's server has no capability for data, parameters or
calls from a client, and is fed only while somebody is connected by the link.
"""

from __future__ import annotations

import asyncio
import logging
import ssl
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address

import foxglove
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from foxglove.websocket import ChannelView, Client, ServerListener
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import WebSocketException
from websockets.typing import Subprotocol

from schemas.errors import TrocarError
from webconsole.console import Console
from webconsole.foxglove.channels import Channel, channels_of

__all__ = ["Face"]

log = logging.getLogger(__name__)

_PERIOD_S = 1.0 / 30.0
_TROUBLE_S = 1.0
_MOST_CLIENTS = 8
_BACKLOG = 256
"""Messages waiting for a client; beyond, the oldest is dropped."""
_LOOPBACK = "127.0.0.1"


class _Subscribed(ServerListener):
    """Takes note of newly subscribed topics, in the SDK's own thread."""

    def __init__(self) -> None:
        self.topics = deque[str]()

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002
        """Take note of a topic."""
        self.topics.append(channel.topic)


class Face:
    """Serves Foxglove the contents of a console's pages; to be closed at the end."""

    def __init__(self, console: Console) -> None:
        self._console = console
        certificate, key = _certificate()
        self._trust = ssl.create_default_context(cadata=certificate.decode("ascii"))
        self._context, self._subscribed = foxglove.Context(), _Subscribed()
        self._server = foxglove.start_server(
            name="Trocar",
            host=_LOOPBACK,
            port=0,
            capabilities=[],
            server_listener=self._subscribed,
            context=self._context,
            message_backlog_size=_BACKLOG,
            tls_cert=certificate,
            tls_key=key,
        )
        self._generation = -1
        self._channels: list[Channel] = []
        self._clients = 0
        self._feeding: asyncio.Task[None] | None = None

    @property
    def port(self) -> int:
        """Where the SDK's server listens."""
        return self._server.port

    def close(self) -> None:
        """Serve no longer."""
        self._server.stop()

    async def relay(self, websocket: WebSocket) -> None:
        """Connect an admitted client with the SDK's server, until either leaves."""
        if self._clients >= _MOST_CLIENTS:
            await websocket.close(1013, f"{_MOST_CLIENTS} clients are connected already")
            return
        self._clients += 1
        if self._feeding is None:
            self._feeding = asyncio.create_task(self._feed())
        try:
            await self._relay_messages(websocket)
        finally:
            self._clients -= 1
            if not self._clients:
                self._feeding.cancel()
                self._feeding = None
                self._console.want(self, None)

    async def _relay_messages(self, websocket: WebSocket) -> None:
        offered = [Subprotocol(one) for one in websocket.scope["subprotocols"]]
        address = f"wss://{_LOOPBACK}:{self.port}"
        try:
            async with connect(
                address, ssl=self._trust, subprotocols=offered, compression=None, max_size=None, proxy=None
            ) as inside:
                await websocket.accept(subprotocol=inside.subprotocol)
                try:
                    await _relay_both(websocket, inside)
                finally:
                    inside.transport.abort()  # the SDK (0.30) may never answer a close
        except WebSocketException as error:  # it offered no protocol of Foxglove
            log.warning("a client of Foxglove is refused: %s", error)
        with suppress(RuntimeError, WebSocketDisconnect):  # it is closed already
            await websocket.close()

    async def _feed(self) -> None:
        """Send new values of the subscribed topics, at most 30 times a second."""
        source, troubles = self._console.source, set[str]()
        while True:
            try:
                await self._follow()
                self._repeat_constants()
                for channel in self._channels:
                    channel.put(lambda name: source.newest(name, None))
            except TrocarError as error:
                if str(error) not in troubles:
                    troubles.add(str(error))
                    log.warning("not sent to Foxglove: %s", error)
                await asyncio.sleep(_TROUBLE_S)
            self._console.want(self, frozenset(self._wanted_outlets()))
            await asyncio.sleep(_PERIOD_S)

    def _wanted_outlets(self) -> Iterator[str]:
        return (name for channel in self._channels if channel.has_subscribers for name in channel.outlets)

    def _repeat_constants(self) -> None:
        """Send constant values once more to new subscribers."""
        asked = {self._subscribed.topics.popleft() for _ in range(len(self._subscribed.topics))}
        for channel in self._channels:
            if channel.topic in asked:
                channel.again()

    async def _follow(self) -> None:
        """Offer the topics of the session shown now."""
        source = self._console.live_source()
        if source.generation == self._generation:
            return
        stage = await self._console.stage()
        self._generation = source.generation
        for channel in self._channels:
            channel.close()
        made = () if stage is None else channels_of(stage, source.outlets, source, self._context)
        self._channels = [*made]
        self._server.clear_session()


async def _relay_both(websocket: WebSocket, inside: ClientConnection) -> None:
    ways = [asyncio.create_task(way) for way in (_in(websocket, inside), _send_out(websocket, inside))]
    await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
    for way in ways:
        way.cancel()
    await asyncio.gather(*ways, return_exceptions=True)


async def _in(websocket: WebSocket, inside: ClientConnection) -> None:
    while True:
        message = await websocket.receive()
        if message["type"] != "websocket.receive":
            return
        await inside.send(message.get("text") or message.get("bytes") or b"")


async def _send_out(websocket: WebSocket, inside: ClientConnection) -> None:
    async for message in inside:
        with suppress(WebSocketDisconnect):
            if isinstance(message, str):
                await websocket.send_text(message)
            else:
                await websocket.send_bytes(message)


def _certificate() -> tuple[bytes, bytes]:
    """Return certificate and key of loopback, in PEM, known to this process alone."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "Trocar, for itself alone")])
    now = datetime.now(UTC)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(minutes=5))
        .not_valid_after(now + timedelta(days=30))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ip_address(_LOOPBACK))]), critical=False)
        .sign(key, hashes.SHA256())
    )
    secret = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    return certificate.public_bytes(serialization.Encoding.PEM), secret
