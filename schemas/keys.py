"""The Zenoh keys of a session. Roles are in the key so that an access rule is one line."""

from __future__ import annotations

import re

__all__ = ["PLACE", "ROOT", "Keys", "same_session_name", "topic", "valid_name", "valid_session_name"]

ROOT = "trocar"
PLACE = "place"
"""Port of a gateway that says, once a second, where programs reach it."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_SESSION_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


def valid_name(name: str) -> bool:
    """Return whether `name` is a valid name of a participant or a part of a port, and so of a ROS topic.

    A name begins with a letter; letters, digits and underscores follow.
    """
    return _NAME.fullmatch(name) is not None


def valid_session_name(name: str) -> bool:
    """Return whether `name` is a valid name of a session: as `valid_name`, and with hyphens."""
    return _SESSION_NAME.fullmatch(name) is not None


def same_session_name(name: str, other: str) -> bool:
    """Return whether two names of sessions differ in hyphens and underscores at most.

    Recordings of version 0.2 name a scenario `colon_grasp` whose file is `colon-grasp.yaml`.
    """
    return name.replace("-", "_") == other.replace("-", "_")


def topic(key: str) -> str:
    """Return the ROS topic under which `key` is recorded: the key without root and session."""
    return "/" + key.split("/", 2)[2]


class Keys:
    """The keys of one session."""

    def __init__(self, session: str) -> None:
        self.session = session
        self.prefix = f"{ROOT}/{session}"
        self.grant = f"{self.prefix}/hub/grant"
        self.status = f"{self.prefix}/hub/status"
        self.profile = f"{self.prefix}/hub/profile"

    def energy(self, bond: str) -> str:
        """Key of the energy book of `bond`."""
        return f"{self.prefix}/hub/energy/{bond}"

    def ack(self, participant: str) -> str:
        """Key of the acks of a stepped participant; `*` for all."""
        return f"{self.prefix}/engine/{participant}/ack"

    def output(self, role: str, participant: str, port: str) -> str:
        """Key of an output port; `role` is `engine` for stepped participants, else `device`."""
        return f"{self.prefix}/{role}/{participant}/out/{port}"

    def feed(self, participant: str, port: str) -> str:
        """Key of the messages of an event port for wall-clock devices."""
        return f"{self.prefix}/engine/{participant}/feed/{port}"

    def signals(self, participant: str, reader: str) -> str:
        """Key of the signals of a participant for a wall-clock device or an observer.

        A slow reader misses some messages and delays no other participant.
        """
        return f"{self.prefix}/engine/{participant}/signals/{reader}"

    def view(self, participant: str, port: str) -> str:
        """Key of an output as published for pages; the simulation never waits for pages."""
        return f"{self.prefix}/engine/{participant}/view/{port}"

    def uses(self, device: str, participant: str) -> str:
        """Key of a wall-clock device's list of used signals of a participant."""
        return f"{self.prefix}/device/{device}/uses/{participant}"

    def host_profile(self, host: str) -> str:
        """Key of the profile of a host of the hub's machine (a query); `*` for all."""
        return f"{self.prefix}/host/{host}/profile"

    def dropped_messages(self, role: str, participant: str) -> str:
        """Key of a host's reports of dropped messages, under the name of one of the host's participants."""
        return f"{self.prefix}/{role}/{participant}/refused"

    def observer_status(self, observer: str) -> str:
        """Key of an observer's status; `*` for all."""
        return f"{self.prefix}/engine/{observer}/status"

    def device_status(self, device: str) -> str:
        """Key of a device's status; `*` for all."""
        return f"{self.prefix}/device/{device}/status"

    def link(self, device: str) -> str:
        """Key of the network link commanded for a device."""
        return f"{self.prefix}/hub/link/{device}"

    def control(self, verb: str) -> str:
        """Key of a control queryable."""
        return f"{self.prefix}/control/{verb}"

    def join(self, host: str) -> str:
        """Key of the host `host` to join, forbidden to any other host; `**` for all."""
        return self.control(f"join/{host}")

    def alive(self, role: str, name: str) -> str:
        """Key of a liveliness token."""
        return f"{self.prefix}/alive/{role}/{name}"
