"""The published values of a port of a recorded session, as arrays, messages or a data frame."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hub.recording.bag import Bag, message_errors
from hub.recording.output_port import output_port
from schemas.codec import decode, message_type
from schemas.errors import MessageError, MissingExtraError, RecordingError, did_you_mean
from schemas.message import Message
from schemas.ports import Port
from schemas.vectors import Vector, VectorCodec, has_vector

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["Series"]


class Series:
    """All values of a recorded port, read at their first use.

        joints = recording["robot.PSM1/measured_js"]
        joints.time                 # (n,), s, simulated
        joints.values               # (n, 12): position and velocity of six joints
        joints["position"]          # (n, 6), rad and m, in the order of joints.names
        joints["position.insertion"]    # (n,), m

    Attributes:
        name: The port, `participant.port`, or the topic of a message without a port.
        topic: The topic in the file.
        type: The ROS type of the messages.
    """

    def __init__(self, bag: Bag, topic: str, name: str, declared: Port | None = None) -> None:
        """Wrap a topic of `bag`; `declared` is the port as declared by the participant, if known."""
        self.name, self.topic, self.type = name, topic, bag.topics[topic]
        self._bag, self._declared = bag, declared

    @property
    def unit(self) -> str:
        """Unit of a bare number or array; empty where the type implies SI units."""
        return "" if self._declared is None else self._declared.unit

    @property
    def frame(self) -> str:
        """The frame of the values; empty without a frame."""
        return self._port.frame

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of the columns; empty if these are no joints."""
        return self._port.names

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the parts of a value: `position`, `velocity`; `position`, `orientation`; `data`; ..."""
        return tuple(self._field_slices)

    @property
    def columns(self) -> tuple[str, ...]:
        """Name of each column of `values`, shape (size,): `position.x`, `velocity.insertion`, `data.0`."""
        return tuple(self._columns)

    @property
    def time(self) -> Vector:
        """Simulated time of each message, s, shape (n,)."""
        return self._times_ns / 1e9

    @cached_property
    def values(self) -> NDArray[np.float64]:
        """The numbers of each message, shape (n, size); quaternions are (x, y, z, w).

        Raises RecordingError where the type has no vector form, or a message is not valid.
        """
        codec, (times_ns, payloads) = self._vector_codec, self._raw_messages
        if codec is None:
            return np.zeros((0, 0))
        try:
            return codec.decode_all(payloads)
        except MessageError:  # a device may write joints in another order, or leave the frame out
            rows = [self._row(codec, *row) for row in zip(times_ns.tolist(), payloads, strict=True)]
            return np.stack(rows)

    def messages(self) -> Iterator[tuple[float, Message]]:
        """Yield simulated time (s) and message, oldest first, of any type.

        Raises RecordingError for an invalid message.
        """
        model = message_type(self.type)
        for time_ns, payload in zip(self._times_ns.tolist(), self._raw_messages[1], strict=True):
            with self._message_errors(time_ns):
                message = decode(model, payload)
            yield time_ns / 1e9, message

    def to_frame(self) -> DataFrame:
        """Return a pandas data frame with the index `time` (s) and a column for each of `columns`.

        Raises MissingExtraError without pandas, and the errors of `values`.
        """
        try:
            from pandas import DataFrame, Index
        except ImportError as error:
            raise MissingExtraError("a data frame", "notebook", "pandas") from error
        return DataFrame(self.values, index=Index(self.time, name="time"), columns=list(self.columns))

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return a part, shape (n, width) or of a matrix (n, *shape), or a column, shape (n,).

        Raises RecordingError for a name in neither `fields` nor `columns`.
        """
        if name in self._field_slices:
            part = self.values[:, self._field_slices[name]]
            shape = () if self._declared is None else self._declared.shape
            return part.reshape(len(part), *shape) if shape else part
        if name in self._columns:
            return self.values[:, self._columns[name]]
        hint = did_you_mean(name, [*self._field_slices, *self._columns])
        raise RecordingError(f"port '{self.name}' has no field '{name}'.{hint}")

    def __len__(self) -> int:
        """Return the number of messages."""
        return self._bag.counts[self.topic]

    def __repr__(self) -> str:
        about = [self.type, f"{len(self):,} messages"]
        about += [f"in {self.unit}"] if self.unit else []
        if has_vector(self.type):
            about += [f"frame {self.frame}"] if self.frame else []
            about.append(f"fields {', '.join(self.fields)}")
        return f"<Series {self.name}: {'; '.join(about)}>"

    @cached_property
    def _raw_messages(self) -> tuple[NDArray[np.int64], list[bytes]]:
        return self._bag.column(self.topic)

    @property
    def _times_ns(self) -> NDArray[np.int64]:
        return self._raw_messages[0]

    @cached_property
    def _vector_codec(self) -> VectorCodec | None:
        """The layout of the first message; None if there is no message."""
        if not has_vector(self.type):
            raise RecordingError(
                f"'{self._bag.file}': '{self.name}' is of type {self.type}, which has no vector form: use its"
                " messages()"
            )
        times_ns, payloads = self._raw_messages
        if not payloads:
            return None
        with self._message_errors(int(times_ns[0])):
            return VectorCodec(output_port(self.name, self.type, payloads[0]))

    @cached_property
    def _port(self) -> Port:
        """The port as in the first message, else as declared."""
        codec = self._vector_codec if has_vector(self.type) else None
        if codec is not None:
            return codec.port
        return self._declared or Port(name=self.name, causality="output", type=self.type)

    @property
    def _field_slices(self) -> dict[str, slice]:
        return {} if self._vector_codec is None else self._vector_codec.parts

    @property
    def _columns(self) -> dict[str, int]:
        return {} if self._vector_codec is None else self._vector_codec.columns

    def _row(self, codec: VectorCodec, time_ns: int, payload: bytes) -> Vector:
        with self._message_errors(time_ns):
            return codec.from_message(decode(codec.model, payload))

    def _message_errors(self, time_ns: int) -> AbstractContextManager[None]:
        return message_errors(self._bag, self.topic, time_ns)
