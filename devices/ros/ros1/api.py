"""How programs of ROS 1 and their master call one another: XML-RPC, with answers of a code, a word and a
value.

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

__all__ = ["Answer", "Program", "ProgramServer", "said"]

log = logging.getLogger(__name__)

_TIMEOUT_S = 2.0
"""For a program that is there and does not answer, such as a stopped one."""


class Answer(NamedTuple):
    """What a call returns."""

    code: int
    """1: done; 0: failed; -1: it was no such thing."""
    word: str
    value: Any


def said(value: Any = 0) -> Answer:
    """Return the answer of a call that has succeeded."""
    return Answer(1, "", value)


class _Timed(xmlrpc.client.Transport):
    def make_connection(self, host: Any) -> HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = _TIMEOUT_S
        return connection


class Program:
    """A master or another program, as its callers see it; for one thread at a time."""

    def __init__(self, uri: str, caller: str) -> None:
        """Take its address, `http://host:port`, and the name of the node that calls."""
        self.uri, self._caller = uri, caller
        self._proxy: xmlrpc.client.ServerProxy | None = None

    def call(self, method: str, *arguments: Any) -> Answer:
        """Call a method. Raises DeviceError if there is no answer."""
        return self._answer(self._ask(method, self._caller, *arguments))

    def call_all(self, calls: Sequence[tuple[str, Sequence[Any]]]) -> list[Answer]:
        """Call methods of a master, all in one request. Raises DeviceError if there is no answer."""
        boxed = [{"methodName": method, "params": [self._caller, *arguments]} for method, arguments in calls]
        match self._ask("system.multicall", boxed):
            case [*answers] if len(answers) == len(calls):
                return [self._answer(answer) for answer in answers]
            case other:
                raise self._wrong(other)

    def _ask(self, method: str, *arguments: Any) -> Any:
        try:
            if self._proxy is None:
                self._proxy = xmlrpc.client.ServerProxy(self.uri, transport=_Timed())
            return getattr(self._proxy, method)(*arguments)
        except Exception as error:  # beside errors of its own, xmlrpc lets ValueError, LookupError, zlib.error and more through for what is no answer
            raise DeviceError(f"{self.uri} does not answer '{method}' ({error})") from error

    def _answer(self, answer: Any) -> Answer:
        match answer:
            # in a box of its own where several are asked for
            case [int(code), str(word), value] | [[int(code), str(word), value]]:
                return Answer(code, word, value)
            case _:
                raise self._wrong(answer)

    def _wrong(self, answer: Any) -> DeviceError:
        return DeviceError(f"{self.uri} gives an answer that is none of ROS 1: {answer!r:.200}")

    def close(self) -> None:
        """Close the connection."""
        if self._proxy is not None:
            self._proxy("close")()


class _Handler(SimpleXMLRPCRequestHandler):
    timeout = 10.0  # for one that connects and says nothing

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        log.debug(format, *args)


class _Server(ThreadingMixIn, SimpleXMLRPCServer):
    daemon_threads = True
    block_on_close = False

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ARG002
        log.debug("ROS 1: a call from %s is left unanswered", client_address, exc_info=True)


def _listed(method: Callable[..., Answer], *arguments: Any) -> list[Any]:
    return list(method(*arguments))


class ProgramServer:
    """What others may call of us."""

    def __init__(self, host: str, methods: Mapping[str, Callable[..., Answer]]) -> None:
        """Answer calls of `methods` at `host`, at a free port; each is given the caller's name first."""
        self._server = _Server((host, 0), requestHandler=_Handler, logRequests=False)
        for name, method in methods.items():
            self._server.register_function(partial(_listed, method), name)
        self.uri = f"http://{host}:{self._server.server_address[1]}/"
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.1,), name="ROS 1 calls", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Answer no more."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(timeout=2.0)
