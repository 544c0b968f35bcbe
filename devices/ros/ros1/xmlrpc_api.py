"""The Master API and Slave API of ROS 1: XML-RPC calls returning code, status message and value.

Source: wiki.ros.org/ROS/Master_API and wiki.ros.org/ROS/Slave_API.
"""

from __future__ import annotations

import logging
import threading
import xmlrpc.client
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from http.client import HTTPConnection
from socketserver import ThreadingMixIn
from typing import Any, NamedTuple
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

from schemas.errors import DeviceError

__all__ = ["ApiClient", "ApiResult", "ApiServer", "success"]

log = logging.getLogger(__name__)

_TIMEOUT_S = 2.0
"""Time-out of calls to an existing but silent program, such as a stopped program."""


class ApiResult(NamedTuple):
    """The result of a call."""

    code: int
    """1: success; 0: failure; -1: error of the caller."""
    status_message: str
    value: Any


def success(value: Any = 0) -> ApiResult:
    """Return the result of a successful call."""
    return ApiResult(1, "", value)


class _Timed(xmlrpc.client.Transport):
    def make_connection(self, host: Any) -> HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = _TIMEOUT_S
        return connection


class ApiClient:
    """Calls a master or another node; for one thread at a time."""

    def __init__(self, uri: str, caller_id: str) -> None:
        """`uri`: URI of the far side, `http://host:port`; `caller_id`: name of our node."""
        self.uri, self._caller_id = uri, caller_id
        self._proxy: xmlrpc.client.ServerProxy | None = None

    def call(self, method: str, *arguments: Any) -> ApiResult:
        """Call a method. Raises DeviceError if there is no result."""
        return self._call_result(self._call_server(method, self._caller_id, *arguments))

    def call_all(self, calls: Sequence[tuple[str, Sequence[Any]]]) -> list[ApiResult]:
        """Call methods of a master in a single request. Raises DeviceError if there is no result."""
        requests = [
            {"methodName": method, "params": [self._caller_id, *arguments]} for method, arguments in calls
        ]
        match self._call_server("system.multicall", requests):
            case [*results] if len(results) == len(calls):
                return [self._call_result(result) for result in results]
            case other:
                raise self._invalid_result(other)

    def _call_server(self, method: str, *arguments: Any) -> Any:
        try:
            if self._proxy is None:
                self._proxy = xmlrpc.client.ServerProxy(self.uri, transport=_Timed())
            return getattr(self._proxy, method)(*arguments)
        # for an invalid response xmlrpc raises ValueError, LookupError, zlib.error and more beside its own
        except Exception as error:
            raise DeviceError(f"{self.uri} does not answer '{method}' ({error})") from error

    def _call_result(self, result: Any) -> ApiResult:
        match result:
            # system.multicall returns each in a list of its own
            case [int(code), str(status_message), value] | [[int(code), str(status_message), value]]:
                return ApiResult(code, status_message, value)
            case _:
                raise self._invalid_result(result)

    def _invalid_result(self, result: Any) -> DeviceError:
        return DeviceError(f"{self.uri} returns an invalid result, none of ROS 1: {result!r:.200}")

    def close(self) -> None:
        """Close the connection."""
        if self._proxy is not None:
            self._proxy("close")()


class _Handler(SimpleXMLRPCRequestHandler):
    timeout = 10.0  # for a client that connects and sends nothing

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        log.debug(format, *args)


class _Server(ThreadingMixIn, SimpleXMLRPCServer):
    daemon_threads = True
    block_on_close = False

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ARG002
        log.debug("ROS 1: a call from %s is not answered", client_address, exc_info=True)


def _listed(method: Callable[..., ApiResult], *arguments: Any) -> list[Any]:
    return list(method(*arguments))


class ApiServer:
    """The Slave API of our node, at a free port."""

    def __init__(self, host: str, methods: Mapping[str, Callable[..., ApiResult]]) -> None:
        """Start to serve `methods` at the address `host`; the first argument of each is the caller's id."""
        self._server = _Server((host, 0), requestHandler=_Handler, logRequests=False)
        for name, method in methods.items():
            self._server.register_function(partial(_listed, method), name)
        self.uri = f"http://{host}:{self._server.server_address[1]}/"
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.1,), name="ROS 1 API", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(timeout=2.0)
