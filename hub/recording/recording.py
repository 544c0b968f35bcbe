"""A recorded session: scenario, grants, acks and values.

Topics are the session's keys without `trocar/<session>`.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property
from html import escape
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TypeVar

from packaging.version import InvalidVersion, Version
from pydantic import ValidationError
from pydantic_core import from_json

from hub.planning.plan import Plan
from hub.planning.renamed import current_names
from hub.recording.bag import Bag, message_errors
from hub.recording.moments import Moments
from hub.recording.series import Series
from schemas.codec import decode
from schemas.errors import RecordingError, did_you_mean
from schemas.keys import Keys, topic
from schemas.message import Message
from schemas.ports import Port
from schemas.scenario import Scenario
from schemas.trocar_msgs import AckMessage, CouplingEnergy, GrantMessage, Profile, SessionStatus

__all__ = ["ENERGY_PREFIX", "GRANT_TOPIC", "STATUS_TOPIC", "Recording"]

log = logging.getLogger(__name__)

_OUTPUT = re.compile(r"/(?:engine|device)/([^/]+)/out/(.+)")
"""Topic of an output port: participant, port."""

M = TypeVar("M", bound=Message)

_KEYS = Keys("any")
GRANT_TOPIC = topic(_KEYS.grant)
STATUS_TOPIC = topic(_KEYS.status)
_PROFILE_TOPIC = topic(_KEYS.profile)
ENERGY_PREFIX = topic(_KEYS.energy(""))


class Recording(Bag):
    """The recording of a session, read from a rosbag2 directory or an MCAP file.

    Examples:
        ```python
        recording = Recording("recordings/palpation")
        recording.ports  # names and types
        recording["robot.PSM1/measured_js"]["position"]  # (n, 6), rad and m
        recording["tissue.probe/wrench"].to_frame().plot()  # with pandas
        ```
    """

    _is_age_logged = False

    @cached_property
    def ports(self) -> dict[str, str]:
        """The recorded outputs, `participant.port`, each with the ROS type."""
        return {name: self.topics[topic] for name, topic in sorted(self._ports.items())}

    @property
    def participants(self) -> tuple[str, ...]:
        """Names of all participants recorded, in alphabetical order."""
        parts = [name.split("/") for name in self.topics]
        return tuple(sorted({part[2] for part in parts if len(part) > 3 and part[1] in ("engine", "device")}))

    def __getitem__(self, port: str) -> Series:
        """Return the values of an output port: `participant.port`, or a topic such as `/hub/energy/tip`.

        Raises RecordingError if the port is not recorded; the message names the nearest recorded port.
        """
        topic_name = port if port.startswith("/") else self._ports.get(port)
        if topic_name not in self.topics:
            known = self.topics if port.startswith("/") else self._ports
            raise RecordingError(f"'{self.file}' has no port '{port}'.{did_you_mean(port, known)}")
        return Series(self, topic_name, port, self._declared_ports.get(port))

    def __contains__(self, port: str) -> bool:
        return port in self.topics if port.startswith("/") else port in self._ports

    def __iter__(self) -> Iterator[str]:
        return iter(self.ports)

    def __repr__(self) -> str:
        return (
            f"<Recording {self._display_title}: {self.duration_ns * 1e-9:g} s; participants"
            f" {', '.join(self.participants) or 'none'}; {len(self._ports)} ports;"
            f" {sum(self.counts.values()):,} messages; {self.file}>"
        )

    def _repr_html_(self) -> str:
        """Return the table shown by a notebook."""
        counts = self.counts
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{escape(kind)}</td><td>{counts[self._ports[name]]:,}</td></tr>"
            for name, kind in self.ports.items()
        )
        return (
            f"<p><b>{escape(self._display_title)}</b>, {self.duration_ns * 1e-9:g} s, participants"
            f" {escape(', '.join(self.participants) or 'none')}</p><table><thead><tr><th>port</th>"
            f"<th>type</th><th>messages</th></tr></thead><tbody>{rows}</tbody></table>"
        )

    def _ipython_key_completions_(self) -> list[str]:
        """Return a notebook's completions after `recording[`."""
        return list(self.ports)

    @cached_property
    def _ports(self) -> dict[str, str]:
        """The topic of each recorded port."""
        found: dict[str, str] = {}
        for name in self.topics:
            match = _OUTPUT.fullmatch(name)
            if match:
                found[f"{match[1]}.{match[2]}"] = name
        return found

    @cached_property
    def _declared_ports(self) -> dict[str, Port]:
        """The ports as the participants declared them; empty if not recorded."""
        if "plan.json" not in self.attachments:
            return {}
        participants = self.plan().participants
        return {f"{name}.{port.name}": port for name, one in participants.items() for port in one.ports}

    @property
    def _display_title(self) -> str:
        with suppress(RecordingError):
            return self.scenario().name
        return self.file.stem

    def scenario(self) -> Scenario:
        """Return the resolved scenario. Raises RecordingError if the recording is not of a session."""
        return self._scenario

    @cached_property
    def _scenario(self) -> Scenario:
        if "scenario.json" not in self.attachments:
            raise RecordingError(f"'{self.file}' holds no scenario: it was not recorded by `trocar run`")
        cannot = f"'{self.file}': this version cannot read the scenario in it{self.made_by_newer()}"
        try:
            recorded = from_json(self.attachments["scenario.json"])  # of limited depth
            return Scenario.model_validate(current_names(recorded, self.versions().get("trocar", "")))
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            path = ".".join(str(part) for part in first["loc"])
            raise RecordingError(f"{cannot}: {path}: {first['msg']}") from error
        except (AttributeError, KeyError, TypeError, ValueError) as error:  # not JSON, or not a scenario
            raise RecordingError(f"{cannot}: {type(error).__name__}: {error}") from error

    def made_by_newer(self) -> str:
        """Return a remark if a Trocar newer than the installed version made the recording; else empty."""
        try:
            recorded, own = Version(self.versions().get("trocar", "0")), Version(version("trocar"))
        except (InvalidVersion, RecordingError, PackageNotFoundError):
            return ""
        return (
            f" (Trocar {recorded} has made it, which is newer than {own}: update)" if recorded > own else ""
        )

    def warn_if_newer(self) -> None:
        """Log a warning, once, if a newer Trocar made the recording."""
        if not self._is_age_logged and (remark := self.made_by_newer()):
            log.warning("'%s'%s", self.file, remark)
        self._is_age_logged = True

    def versions(self) -> dict[str, str]:
        """Return the version of each package installed at the time; empty if not recorded."""
        return self._table("versions.json")

    def files(self) -> dict[str, str]:
        """Return the SHA-256 of each file read by the participants, keyed by path; empty if not recorded."""
        return self._table("files.json")

    def _table(self, name: str) -> dict[str, str]:
        try:
            content = from_json(self.attachments.get(name, b"{}"))
            return {str(key): str(value) for key, value in content.items()}
        except (AttributeError, ValueError) as error:
            raise RecordingError(f"'{self.file}': attachment {name} is not a table: {error}") from error

    def plan(self) -> Plan:
        """Return the plan of the session.

        Raises RecordingError if the recording is not of a session, or if the plan contradicts itself.
        """
        return self._plan

    @cached_property
    def _plan(self) -> Plan:
        try:
            plan = Plan.model_validate_json(self.attachments["plan.json"])
        except KeyError:
            raise RecordingError(
                f"'{self.file}' holds no plan.json: it was not recorded by `trocar run`"
            ) from None
        except ValidationError as error:
            raise RecordingError(
                f"'{self.file}': this version cannot read the plan in it{self.made_by_newer()}:"
                f" {error.errors(include_url=False)[0]['msg']}"
            ) from error
        if problem := plan.find_contradiction():
            raise RecordingError(f"'{self.file}': its plan contradicts itself: {problem}")
        return plan

    def directory(self) -> Path:
        """Return the start directory of the scenario's relative paths.

        Raises RecordingError if the recording is not of a session.
        """
        origin = self._table("origin.json")
        if "directory" not in origin:
            raise RecordingError(f"'{self.file}' holds no origin.json: it was not recorded by `trocar run`")
        return Path(origin["directory"])

    def started_ns(self) -> int:
        """Return the wall time of the session's start (ns since 1970); 0 if not recorded.

        Raises RecordingError if the recorded value is no time.
        """
        started = self._table("origin.json").get("started_ns", "0")
        try:
            return int(started)
        except ValueError as error:
            raise RecordingError(
                f"'{self.file}': attachment origin.json has the start '{started[:40]}', expected ns since"
                " 1970"
            ) from error

    def session(self) -> str:
        """Return the name of the session."""
        status = next(self._decode_messages(STATUS_TOPIC, SessionStatus), None)
        return self.scenario().name if status is None else status[1].session

    def grants(self) -> Iterator[GrantMessage]:
        """Yield the grants in their order."""
        return (grant for _, grant in self._decode_messages(GRANT_TOPIC, GrantMessage))

    def last_grant(self) -> GrantMessage | None:
        """Return the grant given last, found by the index; None if there is none."""
        if GRANT_TOPIC not in self.topics:
            return None
        moments = Moments(self)
        found = moments.newest(GRANT_TOPIC, moments.span_ns[1])
        if found is None:
            return None
        with message_errors(self, GRANT_TOPIC, found.time_ns):
            return decode(GrantMessage, found.payload)

    def acks(self, participant: str) -> Iterator[AckMessage]:
        """Yield the acks of `participant` in the order of their steps."""
        return (ack for _, ack in self._decode_messages(topic(_KEYS.ack(participant)), AckMessage))

    def energy(self, bond: str) -> Iterator[tuple[int, CouplingEnergy]]:
        """Yield the energy book of `bond`, with the simulated time (ns) of each entry."""
        return self._decode_messages(ENERGY_PREFIX + bond, CouplingEnergy)

    def statuses(self) -> Iterator[tuple[int, SessionStatus]]:
        """Yield the session's published statuses, with the simulated time (ns)."""
        return self._decode_messages(STATUS_TOPIC, SessionStatus)

    def profile(self) -> Profile | None:
        """Return where the time of the whole run went; None if not measured."""
        profiles = [profile for _, profile in self._decode_messages(_PROFILE_TOPIC, Profile)]
        return profiles[-1] if profiles else None

    def _decode_messages(self, topic_name: str, model: type[M]) -> Iterator[tuple[int, M]]:
        if topic_name not in self.topics:
            return
        for message in self.messages(topic_name):
            with message_errors(self, topic_name, message.time_ns):
                content = decode(model, message.payload)
            yield message.time_ns, content
