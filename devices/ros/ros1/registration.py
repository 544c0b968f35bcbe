"""Keeps our node registered at the master, also when the master starts later or starts again."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from devices.ros.ros1.xmlrpc_api import ApiClient
from schemas.errors import DeviceError

__all__ = ["Entry", "Registration"]

log = logging.getLogger(__name__)

_CHECK_S = 1.0
"""Period of checks of our registration: a restarted master knows no node, and ROS 1 itself registers no node
again.
"""

_AT_ONCE = 100
"""Entries registered per call: the master answers within seconds."""


@dataclass(frozen=True)
class Entry:
    """A registered topic or service."""

    kind: str
    """`Publisher`, `Subscriber` or `Service`."""
    name: str
    details: tuple[str, ...]
    """Arguments between the name and our URI: the type of a topic, the URI of a service."""
    on_registered: Callable[[Any], None] | None = None
    """Gets the value returned by the master: the URIs of a topic's publishers."""

    def register_call(self, uri: str) -> tuple[str, Sequence[str]]:
        """Return method and arguments of the registration for the node at `uri`."""
        return f"register{self.kind}", (self.name, *self.details, uri)

    def unregister_call(self, uri: str) -> tuple[str, Sequence[str]]:
        """Return method and arguments of the end of the registration."""
        return f"unregister{self.kind}", (self.name, self.details[0] if self.kind == "Service" else uri)


class Registration:
    """Thread registering our node at the master."""

    def __init__(self, master: str, node: str, uri: str) -> None:
        """Start; `master` and `uri`: URIs of the master and of our node."""
        self._master, self._node, self._uri = ApiClient(master, node), node, uri
        self._entries: list[Entry] = []
        self._registered = 0
        """Number of registered entries."""
        self._problem = ""
        self._wake = threading.Event()
        self._ending = False
        self._thread = threading.Thread(target=self._run, name="ROS 1 registration", daemon=True)
        self._thread.start()

    def add(self, entry: Entry) -> None:
        """Register a topic or service as soon as the master answers."""
        self._entries.append(entry)
        self._wake.set()

    def _run(self) -> None:
        while not self._ending:
            try:
                self._register_missing()
                self._problem = ""
            # TypeError: a master that returns no list of publishers
            except (DeviceError, TypeError) as error:
                self._registered = 0
                if str(error) != self._problem:
                    self._problem = str(error)
                    log.warning("ROS 1: waiting for the master: %s", error)
            self._wake.wait(_CHECK_S)
            self._wake.clear()

    def _register_missing(self) -> None:
        """Register all entries unknown to the master. Raises DeviceError on failure."""
        known = self._master.call("lookupNode", self._node)
        if known.code != 1:
            self._registered = 0
        elif known.value != self._uri:
            self._registered = 0
            self._check_name(str(known.value))
        if self._entries and not self._registered:
            log.info("ROS 1: '%s' registers at the master at %s", self._node, self._master.uri)
        while fresh := self._entries[self._registered : self._registered + _AT_ONCE]:
            results = self._master.call_all([entry.register_call(self._uri) for entry in fresh])
            for entry, result in zip(fresh, results, strict=True):
                if result.code != 1:
                    raise DeviceError(
                        f"{self._master.uri} does not register {entry.kind.lower()} '{entry.name}':"
                        f" {result.status_message}"
                    )
                if entry.on_registered is not None:
                    entry.on_registered(result.value)
            self._registered += len(fresh)

    def _check_name(self, uri: str) -> None:
        """Raise DeviceError if another node at `uri` runs under our name.

        The other node keeps the name: a master shuts down the older of two nodes of the same name.
        """
        other = ApiClient(uri, self._node)
        try:
            other.call("getPid")
        except DeviceError:
            return
        finally:
            other.close()
        raise DeviceError(
            f"another program at {uri} has the name '{self._node}': rename one of the two gateways in its"
            " scenario"
        )

    def close(self) -> None:
        """Unregister everything, if the master answers."""
        self._ending = True
        self._wake.set()
        self._thread.join(timeout=10.0)
        if self._registered and not self._thread.is_alive():
            try:
                self._master.call_all([entry.unregister_call(self._uri) for entry in self._entries])
            except DeviceError as error:
                log.info("ROS 1: '%s' cannot unregister: %s", self._node, error)
        self._master.close()
