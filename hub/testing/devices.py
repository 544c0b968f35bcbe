"""The conformance check of devices."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from time import monotonic_ns, sleep

import numpy as np

from hub.participant import Device, Sample, Value
from hub.planning.plan import has_simulated_time
from hub.testing.contract import check_declarations, check_message, require
from hub.transport.port_codec import PortCodec
from schemas.errors import TrocarError
from schemas.ros import Header

__all__ = ["check_device"]

_READS, _READ_NS = 20, 10_000_000


def check_device(
    make: Callable[[], Device], *, inputs: Mapping[str, Value] | None = None, directory: Path | None = None
) -> None:
    """Check that the device `make` returns keeps the contract of a device.

        trocar.check_device(lambda: Wave("wave", WaveParams(clock="wall")))

    A device in wall time is read for a fifth of a second, a device in simulated time for as much simulated
    time.

    Args:
        make: Returns a new instance of the same device, not opened, at each call.
        inputs: Values to write to the input ports before each read; default: the start or neutral value.
        directory: Where relative paths start.

    Raises:
        AssertionError: The contract is broken; the message quotes the rule.
    """
    with make() as device:
        check_declarations(device)
        simulated = has_simulated_time(device.ports)
        device.close()  # before `open`
    samples = _samples(make, inputs or {}, directory or Path.cwd())
    if simulated:
        again = _samples(make, inputs or {}, directory or Path.cwd())
        require(
            samples == again,
            "a device in simulated time returns the same samples for the same inputs, but two instances"
            " differ",
        )


def _samples(
    make: Callable[[], Device], inputs: Mapping[str, Value], directory: Path
) -> list[tuple[str, bytes]]:
    """Return port and bytes of all samples of a new device, each checked."""
    with make() as device:
        declared = device.ports
        codecs = {port.name: PortCodec(port) for port in declared}
        device.open(directory)
        require(declared == device.ports, "open() does not change the ports")
        stamps: dict[str, int] = {}
        samples: list[tuple[str, bytes]] = []
        for time_ns in _read_times(simulated=has_simulated_time(declared)):
            for port in declared:
                if port.causality == "input":
                    _write(device, codecs[port.name], inputs)
            for sample in device.read(time_ns):
                _check_sample(sample, codecs, stamps)
                samples.append((sample.port, sample.encode()))
        device.close()
        device.close()  # and a third time at the end of `with`
    return samples


def _read_times(*, simulated: bool) -> Iterator[int]:
    """Yield the times of reading the device; in wall time, wait for each."""
    start_ns = monotonic_ns()
    for i in range(_READS):
        if not simulated:
            sleep(_READ_NS / 1e9)
        yield i * _READ_NS if simulated else monotonic_ns() - start_ns


def _write(device: Device, codec: PortCodec, inputs: Mapping[str, Value]) -> None:
    port = codec.port
    neutral = np.array(port.start or (), np.float64)
    if codec.vector is not None and port.start is None:
        neutral = codec.vector.neutral
    if port.name in inputs or codec.vector is not None:
        try:
            device.write(port.name, inputs.get(port.name, neutral))
        except TrocarError as error:
            raise AssertionError(
                f"write() accepts what its ports declare, but rejected '{port.name}': {error}"
            ) from error


def _check_sample(sample: Sample, codecs: Mapping[str, PortCodec], stamps: dict[str, int]) -> None:
    """Check a sample; `stamps` are the newest of each port (ns)."""
    codec = codecs.get(sample.port)
    outputs = sorted(name for name, known in codecs.items() if known.port.causality == "output")
    if codec is None or codec.port.causality != "output":
        raise AssertionError(
            f"read() returns samples of declared outputs, {outputs}, but one is of '{sample.port}'"
        )
    check_message(codec.port, sample.message, "read()")
    header = getattr(sample.message, "header", None)
    if isinstance(header, Header):
        last = stamps.get(sample.port, header.stamp.ns)
        require(
            header.stamp.ns >= last,
            f"the stamps of '{sample.port}' do not go back, but {header.stamp.ns} ns follows {last} ns",
        )
        stamps[sample.port] = header.stamp.ns
