"""Plays a recording of device samples as if a person held the device.

Time 0 is the first message of the recording, and log times give the pace (as in `ros2 bag play`). The stamps
in the headers become the times at which the samples are played, in the port's clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field, ValidationInfo, field_validator

from devices.samples import Playback, clock_of, stamp_message
from hub.participant import Device, Params, Sample, VectorSample
from hub.recording.bag import Bag, BagMessage
from hub.recording.output_port import output_port
from schemas.codec import decode, message_type
from schemas.errors import MessageError, RecordingError
from schemas.files import find_file
from schemas.message import Message
from schemas.ports import Port
from schemas.quantity import Duration
from schemas.vectors import VectorCodec

__all__ = ["ScriptedDevice", "ScriptedParams"]

_Maker = Callable[[int], Sample]
"""Makes a sample with the stamp (ns) that it is given."""


class ScriptedParams(Params):
    """What is played, and how."""

    open_to_pages: ClassVar[bool] = True

    samples: Annotated[
        Path,
        Field(
            description=(
                "recording of device samples: an .mcap file or a rosbag2 directory, relative to the scenario"
            )
        ),
    ]
    time: Annotated[
        Literal["simulated", "wall"], Field(description="the clock by which the samples are played")
    ] = "simulated"
    rate: Annotated[
        float,
        Field(gt=0, allow_inf_nan=False, description="speed of playing; 2 is twice as fast as recorded"),
    ] = 1.0
    loop: Annotated[bool, Field(description="start again at the end")] = False
    max_age: Annotated[
        Duration | None, Field(gt=0, description="a signal that is older is marked stale; default: never")
    ] = None

    @field_validator("samples")
    @classmethod
    def _find(cls, samples: Path, info: ValidationInfo) -> Path:
        path = find_file(samples, info)
        try:
            _ports(Bag(path), simulated_time=True, max_age_ns=0)
        except (RecordingError, MessageError) as error:
            raise ValueError(str(error)) from error
        return path


class ScriptedDevice(Device):
    """A device that plays a recording: topic `/pose` comes out of port `pose`."""

    params_model = ScriptedParams
    params: ScriptedParams

    def __init__(self, name: str, params: ScriptedParams) -> None:
        super().__init__(name, params)
        self.simulated_time = params.time == "simulated"
        self._playback = Playback()

    @property
    def ports(self) -> tuple[Port, ...]:
        """An output per topic: a signal where the type has a vector form, else an event port."""
        return self._ports

    @cached_property
    def _ports(self) -> tuple[Port, ...]:
        return _ports(
            Bag(self.params.samples),
            simulated_time=self.simulated_time,
            max_age_ns=self.params.max_age or 0,
        )

    # the validated parameters have the samples' whole path
    def open(self, directory: Path) -> None:  # noqa: ARG002
        """Read and validate all samples. Raises RecordingError if one of them is no valid message."""
        bag = Bag(self.params.samples)
        played = sorted(bag.messages(), key=lambda message: message.time_ns)
        try:
            makers = _sample_makers(played, self.ports)
        except MessageError as error:
            raise RecordingError(f"'{bag.file}': {error}") from error
        self._playback = Playback(self._play(played, makers))

    def read(self, t: int) -> list[Sample]:
        """Return the samples up to time `t` not returned before, oldest first."""
        return self._playback.due(t)

    def close(self) -> None:
        """Discard the samples."""
        self._playback = Playback()

    def _play(self, played: list[BagMessage], makers: list[_Maker]) -> Iterator[tuple[int, Sample]]:
        """Yield (time in ns, sample) in order, endlessly if `loop` is set."""
        start, end = played[0].time_ns, played[-1].time_ns
        # between the last sample and the first of the next round: one mean interval
        lap = end - start + max(1, (end - start) // max(1, len(played) - 1))
        offset = 0
        while True:
            for source, make in zip(played, makers, strict=True):
                time_ns = round((source.time_ns - start + offset) / self.params.rate)
                yield time_ns, make(time_ns)
            if not self.params.loop:
                return
            offset += lap


def _sample_makers(played: list[BagMessage], ports: Sequence[Port]) -> list[_Maker]:
    """Return what makes the sample of each message of a recording.

    Messages of a signal are read as numbers, all at once, if they are laid out alike: a hundredth of the time
    that one after the other takes as a model.
    """
    places: dict[str, list[int]] = {}
    for i, message in enumerate(played):
        places.setdefault(_port_name(message.topic), []).append(i)
    makers: dict[int, _Maker] = {}
    for port in ports:
        payloads = [played[i].payload for i in places[port.name]]
        own = _vector_makers(port, payloads) or [
            partial(_restamped_sample, port.name, decode(message_type(port.type), payload))
            for payload in payloads
        ]
        makers.update(zip(places[port.name], own, strict=True))
    return [makers[i] for i in range(len(played))]


def _vector_makers(port: Port, payloads: list[bytes]) -> list[_Maker]:
    """Return what makes the samples of a signal; none if its messages differ in more than their numbers."""
    if port.variability != "signal":
        return []
    codec = VectorCodec(port)
    try:
        return [partial(VectorSample, codec, value) for value in codec.decode_all(payloads)]
    except MessageError:
        return []


def _restamped_sample(port: str, message: Message, time_ns: int) -> Sample:
    return Sample(port, stamp_message(message, time_ns))


def _ports(bag: Bag, *, simulated_time: bool, max_age_ns: int) -> tuple[Port, ...]:
    if not sum(bag.counts.values()):
        raise RecordingError(f"'{bag.file}' holds no messages, so there is nothing to play")
    first: dict[str, BagMessage] = {}
    for topic, count in bag.counts.items():
        if count:
            first[topic] = next(bag.messages(topic))
    ports = (
        output_port(_port_name(topic), message.type, message.payload)
        for topic, message in sorted(first.items())
    )
    return tuple(
        port.model_copy(
            update={
                "clock": clock_of(simulated_time=simulated_time),
                "max_age_ns": max_age_ns if port.variability == "signal" else 0,
            }
        )
        for port in ports
    )


def _port_name(topic: str) -> str:
    return topic.lstrip("/")
