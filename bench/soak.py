"""A long session in real time: does any of its processes grow, in memory, files or threads?

    python -m bench.soak --minutes 30 --output soak

One arm is led by a stylus behind the stand-in of HDAPI, on a device host of its own; the other one by a ROS 2
program that reads joint states and sends `servo_jp` at 100 Hz through the gateway `ros2-zenoh`. All is
recorded. Every 5 s: memory, open files and threads of each process of the session and of its clients; steps,
late steps, real-time factor and latencies as the session reports them.

Writes DIR/samples.csv, DIR/session.csv, DIR/soak.png and DIR/log.txt, and prints what grew after the first
minutes (`--settle`); exit code 1 if the memory of a process grows by 1 MB/h or more, or its files or threads
do. Linux, with a C compiler.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import zenoh

from bench.soak_trends import COLUMNS, SESSION_COLUMNS, Sample, SessionSample, plotted, report
from hub.remote.hub_connection import reach
from hub.security.credentials import OBSERVER
from hub.transport.loopback_port import LoopbackPort
from schemas.codec import decode
from schemas.errors import ConnectError
from schemas.keys import Keys
from schemas.trocar_msgs import SessionStatus
from tests.devices.standins import build
from tests.devices.standins.hd import VARIABLE, HdWorld

ROOT = Path(__file__).parents[1]
NAME = "soak"
EVERY_S, PATIENCE_S = 5.0, 60.0
_PROGRAMS = re.compile(r"programs that share keys with devices may connect at (\S+)")
ARMS = {"PSM1": {"instrument": "400006"}, "PSM2": {"instrument": "400006"}}
SCENARIO: dict[str, Any] = {
    "name": NAME,
    "step": "2 ms",
    "pace": "realtime",
    "scene": {"mounting": "cart", "arms": ARMS},
    "participants": {
        "stylus": {"kind": "touch", "host": "remote", "styluses": {"right": {}}},
        "teleop": {
            "kind": "teleoperation",
            "arm": "PSM1",
            "instrument": "400006",
            "engage": "held",
            "contact_period": "4 ms",
            "planes": [{"normal": [0, 0, 1], "distance": "-136 mm", "stiffness": "200 N/m"}],
        },
        "motion": {"kind": "motion", "initial_state": "homed"},
        "robot": {"kind": "mujoco", "looks": False, "publish_period": "10 ms"},
        "ros": {"kind": "ros2-zenoh", "host": "ros"},
    },
    "order": ["teleop", "motion", "robot"],
    "connections": [
        "stylus.right/pose -> teleop.master",
        "stylus.right/buttons -> teleop.buttons",
        "teleop.contact -> stylus.right/contact",
        "motion.PSM1/setpoint_js -> teleop.measured_js",
        "motion.PSM1/operating_state -> teleop.operating_state",
        "teleop.servo_jp -> motion.PSM1/servo_jp",
        "ros.PSM2/* -> motion.PSM2/*",
        "motion.* -> ros.*",
        "motion.drive/* -> robot.*",
        "robot.* -> motion.sense/*",
    ],
}


class Running:
    """The processes of a session and of its clients, and what the session reports of itself."""

    def __init__(self, folder: Path, output: Path, stack: ExitStack, *, client_s: float) -> None:
        library = build.compile_library("hd.c", folder / "libHD.so")
        world = HdWorld(library, folder / "world")
        self.hand = world.devices[0]
        SCENARIO["participants"]["stylus"]["library"] = str(library)
        file = folder / "soak.json"
        file.write_text(json.dumps(SCENARIO), encoding="utf-8")
        self._log = stack.enter_context((output / "log.txt").open("wb"))
        self._stack, self._roots, self._begun = stack, dict[str, subprocess.Popen[bytes]](), monotonic()
        self._status: tuple[float, SessionStatus] | None = None
        endpoint = LoopbackPort("tcp/127.0.0.1:0").endpoint
        trocar = ("-P", "-m", "hub.command_line")
        recording = str(folder / "recording")
        self.hub = self._start("hub", *trocar, "run", str(file), "--record", recording, "--listen", endpoint)
        observer = stack.enter_context(_reached(endpoint))
        observer.declare_subscriber(Keys(NAME).status, self._receive)
        self._start(
            "device host", *trocar, "device", "stylus", "--connect", endpoint, **{VARIABLE: str(world.file)}
        )
        self._wait_for_steps()
        task = {"arm_name": "PSM2", "rate": 100.0, "seconds": client_s}
        client = (
            str(ROOT / "bench/ros_client.py"),
            "ros2-zenoh",
            self._programs(),
            "stream",
            json.dumps(task),
        )
        process = self._start("ROS client", *client)
        assert process.stdin is not None
        process.stdin.write(b"\n")
        process.stdin.flush()

    def _start(self, name: str, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        paths = {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "bench")])}
        process = subprocess.Popen(
            [sys.executable, *arguments],
            stdin=subprocess.PIPE,
            stdout=self._log,
            stderr=self._log,
            env={**os.environ, **paths, **environment},
            cwd=ROOT,
        )
        self._roots[name] = process
        self._stack.callback(_ended, process)
        return process

    def _receive(self, sample: zenoh.Sample) -> None:
        self._status = monotonic(), decode(SessionStatus, sample.payload.to_bytes())

    def _wait_for_steps(self) -> None:
        end = monotonic() + PATIENCE_S
        while self._status is None or self._status[1].state != "running":
            if monotonic() > end or self.hub.poll() is not None:
                raise RuntimeError("the session does not start; see log.txt")
            sleep(0.1)
        self._begun = monotonic()

    def _programs(self) -> str:
        """Return where ROS programs connect, which the hub logs."""
        found = _PROGRAMS.search(Path(self._log.name).read_text(encoding="utf-8"))
        if found is None:
            raise RuntimeError("the hub does not log where programs connect; see log.txt")
        return found[1]

    def move_hand(self) -> None:
        """Take the stylus up anew, and let it swing onto the table and off it."""
        self.hand.buttons = 0
        sleep(0.2)
        self.hand.amplitude[1], self.hand.frequency = 0.03, 0.5  # HDAPI's y is up
        self.hand.buttons = 1

    def samples(self) -> Iterator[Sample]:
        """Yield what each process takes now. Raises RuntimeError if one of the session has ended."""
        seconds = monotonic() - self._begun
        for name, process in self._roots.items():
            if process.poll() is not None:
                raise RuntimeError(f"{name} has ended after {seconds:.0f} s; see log.txt")
            for child in _family(process.pid):
                label = name if child == process.pid else _label(child)
                try:
                    status = Path(f"/proc/{child}/status").read_text(encoding="utf-8")
                    files = len(list(Path(f"/proc/{child}/fd").iterdir()))
                except FileNotFoundError:  # it has just ended
                    continue
                fields = dict(line.split(":", 1) for line in status.splitlines())
                kib = int(fields["VmRSS"].split()[0]) if "VmRSS" in fields else 0
                yield Sample(seconds, label, child, kib / 1024, files, int(fields["Threads"]))

    def session_sample(self) -> SessionSample:
        """Return what the session last reported of itself."""
        assert self._status is not None
        when, status = self._status
        p99_ms = dict.fromkeys(("device to grant", "grant to state", "state to force"), 0.0)
        for one in status.latencies:
            p99_ms[one.way] = max(p99_ms[one.way], 1e3 * one.p99_s)
        return SessionSample(
            when - self._begun,
            status.sim_time_ns / 1e9,
            status.step,
            status.late_steps,
            status.dropped_messages,
            *p99_ms.values(),
        )


def _ended(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        process.wait(20.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextmanager
def _reached(endpoint: str) -> Iterator[zenoh.Session]:
    """Return a client of the hub, which takes a while to listen."""
    end = monotonic() + PATIENCE_S
    while True:
        try:
            session = reach(endpoint, OBSERVER)
            break
        except ConnectError:
            if monotonic() > end:
                raise
            sleep(0.2)
    with session:
        yield session


def _family(root: int) -> list[int]:
    """Return a process and its descendants."""
    found = [root]
    for process in found:
        for task in Path(f"/proc/{process}/task").glob("*/children"):
            try:
                found += [int(child) for child in task.read_text(encoding="utf-8").split()]
            except FileNotFoundError:  # the thread has just ended
                continue
    return found


def _label(process: int) -> str:
    """Return the name of a process after its module or its host."""
    words = Path(f"/proc/{process}/cmdline").read_text(encoding="utf-8").split("\0")
    if "--host" in words:
        return f"host {words[words.index('--host') + 1]}"
    return words[words.index("-m") + 1] if "-m" in words else Path(words[0]).name


def measured(minutes: float, output: Path) -> tuple[list[Sample], list[SessionSample]]:
    """Run the session, write the samples as they are taken, and return them."""
    samples, session = list[Sample](), list[SessionSample]()
    with tempfile.TemporaryDirectory(dir=output) as folder, ExitStack() as stack:
        files = [
            stack.enter_context((output / name).open("w", newline="", encoding="utf-8", buffering=1))
            for name in ("samples.csv", "session.csv")
        ]
        writers = [csv.writer(file) for file in files]
        for writer, columns in zip(writers, (COLUMNS, SESSION_COLUMNS), strict=True):
            writer.writerow(columns)
        running = Running(Path(folder), output, stack, client_s=60.0 * minutes + 60.0)
        begun = monotonic()
        for number in range(round(60.0 * minutes / EVERY_S)):
            sleep(max(0.0, begun + number * EVERY_S - monotonic()))
            running.move_hand()
            taken = list(running.samples())
            samples += taken
            session.append(running.session_sample())
            writers[0].writerows(taken)
            writers[1].writerow(session[-1])
    return samples, session


def main() -> int:
    """Run, write and print; return 1 if something grows."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--settle", type=float, default=5.0, help="minutes at the start that do not count")
    parser.add_argument("--output", type=Path, default=Path("soak"), help="a folder for what is written")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    samples, session = measured(options.minutes, options.output)
    plotted(samples, session, options.output / "soak.png")
    lines, grows = report(samples, session, 60.0 * options.settle)
    text = "\n".join([*lines, f"load {Path('/proc/loadavg').read_text(encoding='utf-8').strip()}"])
    (options.output / "report.txt").write_text(text + "\n", encoding="utf-8")
    print(text)
    return int(grows)


if __name__ == "__main__":
    sys.exit(main())
