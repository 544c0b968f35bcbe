"""What recording costs a step: a toy step loop with the recorder on against off, interleaved in one run.

The loop is the worst case, one that never lets go of the interpreter: each step is pure Python of about the
given length and writes what a palpation session records, 10 messages of 100 bytes, and every 16 ms one of 3
kB. Beside Trocar's recorder two others take the same messages: the `mcap` package's own writer in a thread,
and in a process behind a pipe.
"""

from __future__ import annotations

import argparse
import json
import queue
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, Protocol

import numpy as np
from mcap.writer import CompressionType, Writer

from hub.recording.recorder import Recorder

CHANNELS = 10
SMALL, LARGE, LARGE_EVERY = 100, 3000, 16
TYPE = "std_msgs/msg/Float64MultiArray"
_FRAME = struct.Struct("<HqI")


class Sink(Protocol):
    """Whatever takes messages."""

    def write(self, channel: int, time_ns: int, payload: bytes, /) -> None:
        """Take one message."""

    def close(self) -> object:
        """Write what is left."""


def _library_writer(stream: BinaryIO) -> Writer:
    writer = Writer(stream, chunk_size=64 * 2**10, compression=CompressionType.LZ4)
    writer.start("ros2")
    schema = writer.register_schema(TYPE, "ros2msg", b"")
    for channel in range(CHANNELS + 1):
        writer.register_channel(f"/{channel}", "cdr", schema)
    return writer


class LibraryThread:
    """The `mcap` package's writer, fed through a queue by a thread."""

    def __init__(self, directory: Path) -> None:
        self._stream = (directory / "library.mcap").open("wb")
        self._queue: queue.SimpleQueue[tuple[int, int, bytes] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def write(self, channel: int, time_ns: int, payload: bytes) -> None:
        """Queue one message."""
        self._queue.put((channel, time_ns, payload))

    def close(self) -> None:
        """Wait for the thread."""
        self._queue.put(None)
        self._thread.join()
        self._stream.close()

    def _run(self) -> None:
        writer = _library_writer(self._stream)
        while (item := self._queue.get()) is not None:
            writer.add_message(item[0], item[1], item[2], item[1])
        writer.finish()


class LibraryProcess:
    """The `mcap` package's writer in a process of its own, behind a pipe that takes 32 KiB at a time."""

    def __init__(self, directory: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, __file__, "--sink", directory / "process.mcap"],
            stdin=subprocess.PIPE,
            bufsize=2**15,
        )
        assert self._process.stdin is not None
        self._pipe = self._process.stdin
        self._pipe.write(_FRAME.pack(1, 0, 0))
        self._pipe.flush()

    def write(self, channel: int, time_ns: int, payload: bytes) -> None:
        """Send one message."""
        self._pipe.write(_FRAME.pack(channel, time_ns, len(payload)) + payload)

    def close(self) -> None:
        """Wait for the process."""
        self._pipe.close()
        self._process.wait()


def _sink_process(path: Path) -> None:
    with path.open("wb") as stream:
        writer = _library_writer(stream)
        while header := sys.stdin.buffer.read(_FRAME.size):
            channel, time_ns, size = _FRAME.unpack(header)
            writer.add_message(channel, time_ns, sys.stdin.buffer.read(size), time_ns)
        writer.finish()


def _messages(steps: int) -> list[list[tuple[int, int, bytes]]]:
    """Per step (channel, time in ns, payload): slowly changing doubles, as those of a session."""
    noise = np.random.default_rng(0)
    walk = np.cumsum(noise.normal(size=(steps, CHANNELS, SMALL // 8)) * 1e-6, axis=0)
    nodes = noise.normal(size=LARGE // 8)
    rows: list[list[tuple[int, int, bytes]]] = []
    for step in range(steps):
        time_ns = step * 1_000_000
        row = [
            (channel + 1, time_ns, bytes(4) + walk[step, channel].tobytes()) for channel in range(CHANNELS)
        ]
        if step % LARGE_EVERY == 0:
            row.append((CHANNELS + 1, time_ns, bytes(4) + (nodes + 1e-6 * step).tobytes()))
        rows.append(row)
    return rows


def _work(turns: int) -> int:
    total = 0
    for i in range(turns):
        total += i
    return total


def _turns(step_s: float) -> int:
    begin = time.perf_counter()
    _work(1_000_000)
    return int(1_000_000 * step_s / (time.perf_counter() - begin))


def _block(
    rows: list[list[tuple[int, int, bytes]]], turns: int, write: Callable[[int, int, bytes], object]
) -> float:
    begin = time.perf_counter()
    for row in rows:
        _work(turns)
        for channel, time_ns, payload in row:
            write(channel, time_ns, payload)
    return time.perf_counter() - begin


def _ignore(_channel: int, _time_ns: int, _payload: bytes) -> None:
    return


def _ratio(name: str, step_ms: float, steps: int, rounds: int) -> float:
    """Return loop time with a recorder over loop time without.

    It is the median over pairs of short blocks: other load falls on both of a pair.
    """
    rows, turns = _messages(steps), _turns(step_ms * 1e-3)
    with tempfile.TemporaryDirectory() as directory:
        sink = _sink(name, Path(directory))
        pairs = [(_block(rows, turns, _ignore), _block(rows, turns, sink.write)) for _ in range(rounds)]
        sink.close()
    return statistics.median(on / off for off, on in pairs)


def _cpu_us_per_step(name: str, rounds: int) -> float:
    """Return the CPU time that recording a step takes in this process, of the fastest round.

    Writer thread and compression are included.
    """
    rows, times = _messages(4000), list[float]()  # many, so that opening and closing the file do not count
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as directory:
            sink = _sink(name, Path(directory))
            begin = time.process_time()
            for row in rows:
                for channel, time_ns, payload in row:
                    sink.write(channel, time_ns, payload)
            sink.close()
            times.append(time.process_time() - begin)
    return min(times) / len(rows) * 1e6


def measure(step_ms: float, steps: int, rounds: int) -> dict[str, float]:
    """Return ratio and CPU time of each recorder."""
    results: dict[str, float] = {"step_ms": step_ms}
    for name in ("recorder", "mcap_writer_thread", "mcap_writer_process"):
        results[f"{name}_ratio"] = _ratio(name, step_ms, steps, rounds)
        results[f"{name}_cpu_us_per_step"] = _cpu_us_per_step(name, 8)
    return results


def _sink(name: str, directory: Path) -> Sink:
    if name == "mcap_writer_thread":
        return LibraryThread(directory)
    if name == "mcap_writer_process":
        return LibraryProcess(directory)
    recorder = Recorder(directory / "run", attachments={})
    for channel in range(CHANNELS + 1):
        recorder.add_channel(f"/{channel}", TYPE)
    return recorder


def main() -> None:
    """Print the ratios."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--step-ms", type=float, default=1.0, help="length of a step of the loop")
    parser.add_argument("--steps", type=int, default=50, help="steps per block")
    parser.add_argument("--rounds", type=int, default=200, help="blocks with, and without")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--sink", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.sink:
        _sink_process(options.sink)
        return
    results = measure(options.step_ms, options.steps, options.rounds)
    if options.json:
        print(json.dumps(results))
        return
    for name, value in results.items():
        print(f"{name:30} {value:.3f}")


if __name__ == "__main__":
    main()
