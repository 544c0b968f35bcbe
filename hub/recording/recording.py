"""A recorded session: its scenario, grants, acks and values.

Topics are the session's keys without `trocar/<session>`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from hub.planning.plan import Plan
from hub.planning.renamed import current_names
from hub.recording.bag import Bag, output_port
from schemas.codec import decode
from schemas.errors import MessageError, RecordingError
from schemas.keys import Keys, topic
from schemas.message import Message
from schemas.scenario import Scenario
from schemas.trocar_msgs import AckMessage, CouplingEnergy, GrantMessage, SessionStatus
from schemas.vectors import Vector, VectorCodec, has_vector

__all__ = ["ENERGY_PREFIX", "GRANT_TOPIC", "STATUS_TOPIC", "Recording"]

M = TypeVar("M", bound=Message)

_KEYS = Keys("any")
GRANT_TOPIC = topic(_KEYS.grant)
STATUS_TOPIC = topic(_KEYS.status)
ENERGY_PREFIX = topic(_KEYS.energy(""))


class Recording(Bag):
    """The recording of one session, read from a rosbag2 directory or an MCAP file."""

    def scenario(self) -> Scenario:
        """Return the resolved scenario. Raises RecordingError if the recording is not one of a session."""
        try:
            return Scenario.model_validate(current_names(json.loads(self.attachments["scenario.json"])))
        except KeyError:
            raise RecordingError(
                f"'{self.file}' holds no scenario: it was not recorded by `trocar run`"
            ) from None
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            path = ".".join(str(part) for part in first["loc"])
            raise RecordingError(
                f"'{self.file}': the scenario in it is none that this version reads: {path}: {first['msg']}"
            ) from error

    def versions(self) -> dict[str, str]:
        """Return the versions of the packages that recorded; empty if they are not stated."""
        return self._table("versions.json")

    def files(self) -> dict[str, str]:
        """Return the SHA-256 of the files that the participants read, by path; empty if they are not stated."""
        return self._table("files.json")

    def _table(self, name: str) -> dict[str, str]:
        try:
            content = json.loads(self.attachments.get(name, b"{}"))
            return {str(key): str(value) for key, value in content.items()}
        except (AttributeError, ValueError) as error:
            raise RecordingError(f"'{self.file}': attachment {name} is no table: {error}") from error

    def plan(self) -> Plan:
        """Return the wiring. Raises RecordingError if the recording is not one of a session."""
        try:
            return Plan.model_validate_json(self.attachments["plan.json"])
        except KeyError:
            raise RecordingError(
                f"'{self.file}' holds no plan.json: it was not recorded by `trocar run`"
            ) from None
        except ValidationError as error:
            raise RecordingError(
                f"'{self.file}': the plan in it is none that this version reads:"
                f" {error.errors(include_url=False)[0]['msg']}"
            ) from error

    def directory(self) -> Path:
        """Return where relative paths of the scenario started.

        Raises RecordingError if the recording is not one of a session.
        """
        origin = self._table("origin.json")
        if "directory" not in origin:
            raise RecordingError(f"'{self.file}' holds no origin.json: it was not recorded by `trocar run`")
        return Path(origin["directory"])

    def started_ns(self) -> int:
        """Return the wall time (ns since 1970) at which the session was started; 0 if it is not stated."""
        return int(self._table("origin.json").get("started_ns", 0))

    def session(self) -> str:
        """Return the name of the session."""
        status = next(self._decoded(STATUS_TOPIC, SessionStatus), None)
        return self.scenario().name if status is None else status[1].session

    def grants(self) -> Iterator[GrantMessage]:
        """Yield the grants in the order in which they were given."""
        return (grant for _, grant in self._decoded(GRANT_TOPIC, GrantMessage))

    def acks(self, participant: str) -> Iterator[AckMessage]:
        """Yield the acks of `participant` in the order in which they came."""
        return (ack for _, ack in self._decoded(topic(_KEYS.ack(participant)), AckMessage))

    def energy(self, bond: str) -> Iterator[tuple[int, CouplingEnergy]]:
        """Yield the energy book of `bond`, with the simulated time (ns) of each entry."""
        return self._decoded(ENERGY_PREFIX + bond, CouplingEnergy)

    def statuses(self) -> Iterator[tuple[int, SessionStatus]]:
        """Yield what the session said of itself, with the simulated time (ns)."""
        return self._decoded(STATUS_TOPIC, SessionStatus)

    def series(self, topic_name: str) -> tuple[Vector, NDArray[np.float64]]:
        """Return times in s, shape (n,), and values, shape (n, size), of a topic whose type has a vector
        layout.
        """
        if not has_vector(self.topics.get(topic_name, "")) and topic_name in self.topics:
            raise RecordingError(
                f"'{self.file}': topic '{topic_name}' is of type {self.topics[topic_name]}, which has no"
                " vector form"
            )
        times: list[int] = []
        values: list[Vector] = []
        codec: VectorCodec | None = None
        for message in self.messages(topic_name):
            try:
                codec = codec or VectorCodec(output_port(topic_name, message.type, message.payload))
                values.append(_vector(codec, message.payload))
            except MessageError as error:
                raise RecordingError(
                    f"'{self.file}': topic '{topic_name}' at {message.time_ns} ns: {error}"
                ) from error
            times.append(message.time_ns)
        size = 0 if codec is None else codec.size
        return np.asarray(times, np.float64) * 1e-9, np.asarray(values, np.float64).reshape(len(times), size)

    def _decoded(self, topic_name: str, model: type[M]) -> Iterator[tuple[int, M]]:
        if topic_name not in self.topics:
            return
        for message in self.messages(topic_name):
            try:
                yield message.time_ns, decode(model, message.payload)
            except MessageError as error:
                raise RecordingError(
                    f"'{self.file}': topic '{topic_name}' at {message.time_ns} ns: {error}"
                ) from error


def _vector(codec: VectorCodec, payload: bytes) -> Vector:
    try:
        return codec.decode(payload)
    except MessageError:  # a device may write joints in another order, or leave the frame out
        return codec.from_message(decode(codec.model, payload))
