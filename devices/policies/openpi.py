"""Policies behind a websocket server of openpi; vLLM and LeRobot have servers of the same protocol.

The server sends its metadata first. Each observation is answered by a message with `actions`; a text is the
traceback of an error. Source: Physical-Intelligence/openpi, docs/remote_inference.md; openpi-client 0.1.2.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Any, cast
from urllib.parse import urlsplit

from devices.policies.array_messages import MOST_BYTES, check_package, pack_openpi, unpack
from devices.policies.policy import Observation, check_actions
from devices.policies.statement import check_statement
from robots.policies.terms import Terms
from schemas.errors import DeviceError, MessageError
from schemas.vectors import Vector

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

__all__ = ["OpenPiPolicy"]

_CAMERA_KEYS = ("observation/image", "observation/wrist_image")
"""Names of the first cameras in policies for LIBERO and DROID."""
_TEXT_LENGTH = 300


class OpenPiPolicy:
    """A connection to a server. After a DeviceError it is closed; open another."""

    def __init__(self, backend: str, terms: Terms, timeout_s: float) -> None:
        """Connect, and check the server's metadata; raises as `open_policy`."""
        check_package(backend, "msgpack", "websockets")
        from websockets.exceptions import WebSocketException
        from websockets.sync.client import connect

        self._backend, self._terms, self._timeout_s = backend, terms, timeout_s
        self._keys = {name: _camera_key(i, name, terms) for i, name in enumerate(terms.cameras)}
        self._connection: ClientConnection | None = None
        self._open = ExitStack()
        address = urlsplit(backend)
        try:
            connecting = connect(
                f"ws://{address.netloc}",
                compression=None,
                max_size=MOST_BYTES,
                open_timeout=timeout_s,
                close_timeout=1.0,
                proxy=None,
            )
            self._connection = self._open.enter_context(connecting)
        except (OSError, WebSocketException) as error:
            raise DeviceError(f"policy '{backend}' cannot be reached: {error}") from error
        try:
            metadata = self._receive()
            if not isinstance(metadata, dict):
                raise MessageError(f"policy '{backend}' begins with {metadata!r:.100}, expected its metadata")
            self._metadata = cast("Mapping[str, Any]", metadata)
            check_statement(backend, self._metadata, terms)
        except BaseException:
            self.close()
            raise

    @property
    def metadata(self) -> Mapping[str, Any]:
        """First message of the server."""
        return self._metadata

    def reset(self, episode: int) -> None:
        """Do nothing: the protocol has no episodes."""

    def act(self, observation: Observation) -> Vector:
        """Return the rows of actions."""
        self._check_silence()
        tree: dict[str, Any] = {self._keys[name]: image for name, image in observation.images.items()}
        if observation.state.size:
            tree["observation/state"] = observation.state
        tree["prompt"] = observation.instruction
        self._send(pack_openpi({**tree, **observation.extra}))
        answer = self._receive()
        if not isinstance(answer, dict) or "actions" not in answer:
            raise MessageError(f"policy '{self._backend}' answers without 'actions'")
        return check_actions(cast("dict[str, Any]", answer)["actions"], self._terms)

    def _check_silence(self) -> None:
        """Raise DeviceError for a message before the question: it answers a question of another session."""
        from websockets.exceptions import ConnectionClosed

        if self._connection is None:
            return
        try:
            self._connection.recv(timeout=0)
        except TimeoutError:
            return
        except ConnectionClosed as error:
            raise self._lost(error) from error
        self.close()
        raise DeviceError(
            f"policy '{self._backend}' has sent an answer before the question: another session's?"
        )

    def _send(self, message: bytes) -> None:
        from websockets.exceptions import ConnectionClosed

        try:
            self._open_connection.send(message)
        except (ConnectionClosed, OSError) as error:
            raise self._lost(error) from error

    def _receive(self) -> Any:
        from websockets.exceptions import ConnectionClosed

        try:
            message = self._open_connection.recv(timeout=self._timeout_s)
        except TimeoutError as error:
            self.close()  # the answer, should it come, is to an old question
            raise DeviceError(
                f"policy '{self._backend}' has not answered within {self._timeout_s:g} s"
            ) from error
        except (ConnectionClosed, OSError) as error:
            raise self._lost(error) from error
        if isinstance(message, str):
            text = message if len(message) <= _TEXT_LENGTH else f"... {message[-_TEXT_LENGTH:]}"
            raise MessageError(f"policy '{self._backend}' reports an error: {text.strip()}")
        return unpack(message)

    @property
    def _open_connection(self) -> ClientConnection:
        if self._connection is None:
            raise DeviceError(f"policy '{self._backend}' is closed")
        return self._connection

    def _lost(self, error: Exception) -> DeviceError:
        self.close()
        return DeviceError(f"policy '{self._backend}' has gone: {error}")

    def close(self) -> None:
        """Disconnect."""
        self._connection = None
        with suppress(OSError):
            self._open.close()


def _camera_key(place: int, name: str, terms: Terms) -> str:
    key = terms.cameras[name].key
    if key:
        return key
    return _CAMERA_KEYS[place] if place < len(_CAMERA_KEYS) else f"observation/{name.replace('/', '_')}"
