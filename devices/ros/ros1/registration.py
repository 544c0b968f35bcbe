"""Keeps a node known to its master: from when there is one, and again when there is another one."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from devices.ros.ros1.api import Program
from schemas.errors import DeviceError

__all__ = ["Registration", "Thing"]

log = logging.getLogger(__name__)

_LOOK_S = 1.0
"""How often it is looked whether the master still knows us: programs of ROS 1 do not register again by
themselves, and find nobody after a restart.
"""

_AT_ONCE = 100
"""Things told in one call: a master is to answer within seconds."""


@dataclass(frozen=True)
class Thing:
    """What a master is told of."""

    kind: str
    """`Publisher`, `Subscriber` or `Service`."""
    name: str
    details: tuple[str, ...]
    """What stands between the name and our address: the type of a topic, the address of a service."""
    told: Callable[[Any], None] | None = None
    """Takes the master's answer: the addresses of a topic's publishers."""

    def registering(self, uri: str) -> tuple[str, Sequence[str]]:
        """Return the call that registers it for the node at `uri`."""
        return f"register{self.kind}", (self.name, *self.details, uri)

    def unregistering(self, uri: str) -> tuple[str, Sequence[str]]:
        """Return the call that takes it back."""
        return f"unregister{self.kind}", (self.name, self.details[0] if self.kind == "Service" else uri)


class Registration:
    """A thread that talks to the master."""

    def __init__(self, master: str, node: str, uri: str) -> None:
        """Take the master's address, the name of our node and its address, and begin."""
        self._master, self._node, self._uri = Program(master, node), node, uri
        self._things: list[Thing] = []
        self._known = 0
        """How many of them the master has been told of."""
        self._obstacle = ""
        self._stir = threading.Event()
        self._ending = False
        self._thread = threading.Thread(target=self._run, name="ROS 1 registration", daemon=True)
        self._thread.start()

    def add(self, thing: Thing) -> None:
        """Have the master told of a thing."""
        self._things.append(thing)
        self._stir.set()

    def _run(self) -> None:
        while not self._ending:
            try:
                self._look()
                self._obstacle = ""
            except (
                DeviceError,
                TypeError,
            ) as error:  # TypeError: a master that tells of no list of publishers
                self._known = 0
                if str(error) != self._obstacle:
                    self._obstacle = str(error)
                    log.warning("ROS 1: waiting for the master: %s", error)
            self._stir.wait(_LOOK_S)
            self._stir.clear()

    def _look(self) -> None:
        """Tell the master what it does not know. Raises DeviceError if it cannot be told."""
        there = self._master.call("lookupNode", self._node)
        if there.code != 1:
            self._known = 0
        elif there.value != self._uri:
            self._known = 0
            self._yield(str(there.value))
        if self._things and not self._known:
            log.info("ROS 1: '%s' makes itself known to the master at %s", self._node, self._master.uri)
        while fresh := self._things[self._known : self._known + _AT_ONCE]:
            answers = self._master.call_all([thing.registering(self._uri) for thing in fresh])
            for thing, answer in zip(fresh, answers, strict=True):
                if answer.code != 1:
                    raise DeviceError(
                        f"{self._master.uri} does not take {thing.kind.lower()} '{thing.name}': {answer.word}"
                    )
                if thing.told is not None:
                    thing.told(answer.value)
            self._known += len(fresh)

    def _yield(self, uri: str) -> None:
        """Leave its name to another node that lives: a master has the elder of two of one name shut down.

        Raises DeviceError if there is one.
        """
        other = Program(uri, self._node)
        try:
            other.call("getPid")
        except DeviceError:
            return
        finally:
            other.close()
        raise DeviceError(
            f"another program is '{self._node}' there, at {uri}: call one of the two gateways otherwise in"
            " its scenario"
        )

    def close(self) -> None:
        """Take everything back, if the master is there."""
        self._ending = True
        self._stir.set()
        self._thread.join(timeout=10.0)
        if self._known and not self._thread.is_alive():
            try:
                self._master.call_all([thing.unregistering(self._uri) for thing in self._things])
            except DeviceError as error:
                log.info("ROS 1: the master is not told that '%s' ends: %s", self._node, error)
        self._master.close()
