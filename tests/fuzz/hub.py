"""Mutated requests and messages to the hub of a session: each request is answered, and the session goes on.

`python -m tests.fuzz.hub --number 10000 --seed 7 --hours 1`. A case stands for one request or message; what a
hub has received before may matter, so repeat a failure with its seed and number, not with its case alone.
"""

from __future__ import annotations

import atexit
import json
import os
import random
import struct
import subprocess
import sys
from functools import cache
from pathlib import Path
from time import monotonic, sleep

import zenoh

from hub.remote.hub_connection import reach
from hub.remote.live_sessions import live_sessions
from hub.security.credentials import OBSERVER
from hub.transport.envelope import Stamp, Tag
from hub.transport.loopback_port import LoopbackPort
from schemas.codec import decode
from schemas.errors import MessageError
from schemas.keys import Keys
from schemas.ros import StringMessage
from tests.fuzz.byte_mutations import mutated, mutated_text
from tests.fuzz.harness import LARGEST_MB, Note, Target, search
from tests.fuzz.wire import cdr

KEYS = Keys("fuzzed")
SCENARIO = {
    "name": "fuzzed",
    "step": "10 ms",
    "pace": "realtime",
    "participants": {
        "console": {"kind": "simulated-touch", "styluses": {"right": {"path": [{"at": 0, "buttons": [0]}]}}},
        "teleop": {"kind": "teleoperation", "host": "other"},
        "keys": {"kind": "ros2-zenoh", "host": "gateway", "arms": {"PSM1": {"instrument": "400006"}}},
    },
    "connections": ["console.right/pose -> teleop.master"],
}
REQUESTS = {
    "pause": "{}",
    "resume": "{}",
    "step": '{"steps": 3}',
    "clock": "{}",
    "set": '{"participant": "teleop", "port": "scale", "value": [0.5]}',
    "link": '{"device": "console", "delay": "70 ms", "jitter": "1 ms", "loss": 0.1, "outage": 5}',
    "join/other": '{"host": "other", "pid": 7, "ready": true, "bonds": {}, "failed": ""}',
}
MESSAGES = {
    KEYS.ack("teleop"): "trocar_msgs/msg/Ack",
    KEYS.output("engine", "teleop", "servo_jp"): "sensor_msgs/msg/JointState",
    KEYS.output("device", "keys", "PSM1/servo_jp"): "sensor_msgs/msg/JointState",
    KEYS.output("device", "keys", "PSM1/hold"): "std_msgs/msg/Empty",
    KEYS.signals("teleop", "keys"): "std_msgs/msg/Float64",
    KEYS.uses("keys", "teleop"): "std_msgs/msg/String",
    KEYS.device_status("keys"): "trocar_msgs/msg/DeviceStatus",
    KEYS.dropped_messages("engine", "teleop"): "std_msgs/msg/String",
    KEYS.link("keys"): "std_msgs/msg/String",
}
PATIENCE_S = 300.0


class Hub:
    """A hub in a process of its own, which is ended with this one."""

    def __init__(self, directory: Path) -> None:
        file = directory / "fuzzed.json"
        file.write_text(json.dumps(SCENARIO), encoding="utf-8")
        self.endpoint = LoopbackPort("tcp/127.0.0.1:0").endpoint
        self.log = directory / "hub.txt"
        with self.log.open("wb") as log:
            command = [
                sys.executable,
                "-P",
                "-m",
                "hub.command_line",
                "run",
                str(file),
                "--listen",
                self.endpoint,
            ]
            self.process = subprocess.Popen(command, stdout=log, stderr=log)
        atexit.register(self.process.terminate)
        self.usual_mb = 0.0

    def wait(self) -> None:
        """Wait until the session runs."""
        end = monotonic() + PATIENCE_S
        while not any(status.step > 10 for status in live_sessions([self.endpoint])):
            assert monotonic() < end, self.log.read_text(encoding="utf-8")
            sleep(0.1)

    def memory_mb(self) -> float:
        """Return the resident memory of the hub's own process."""
        fields = Path(f"/proc/{self.process.pid}/status").read_text(encoding="utf-8").split()
        return int(fields[fields.index("VmRSS:") + 1]) / 1024

    def check(self) -> None:
        """Raise AssertionError unless the session goes on, and within its memory."""
        said = self.log.read_text(encoding="utf-8", errors="replace")
        assert "Traceback" not in said, said[-3000:]
        assert [status.state for status in live_sessions([self.endpoint])][:1] in (["running"], ["paused"]), (
            said
        )
        assert self.memory_mb() - self.usual_mb < LARGEST_MB, "the hub takes too much memory"


@cache
def _hub(directory: Path) -> Hub:
    return Hub(directory)


@cache
def _client(endpoint: str) -> zenoh.Session:
    return reach(endpoint, OBSERVER)


def attempt(case: str, directory: Path, note: Note) -> None:
    """Send the request or message of `case`, SEED:NUMBER; now and then, see whether the session goes on."""
    source, hub = random.Random(case), _hub(directory)
    if source.random() < 0.02:
        note("check")
        hub.check()
    elif source.random() < 0.6:
        _ask(source, _client(hub.endpoint), note)
    else:
        _publish(source, _client(hub.endpoint), note)


def _ask(source: random.Random, client: zenoh.Session, note: Note) -> None:
    verb, text = source.choice(sorted(REQUESTS.items()))
    label, data = mutated_text(text.encode(), source)
    payload = struct.pack("<4sI", b"\0\1\0\0", len(data) + 1) + data + b"\0"
    if source.random() < 0.2:
        label, payload = mutated(payload, source)
    note(f"{verb}: {label}")
    answers = [
        decode(StringMessage, reply.ok.payload.to_bytes()).data
        for reply in client.get(KEYS.control(verb), payload=payload, timeout=20.0)
        if reply.ok is not None
    ]
    assert len(answers) == 1, f"{len(answers)} answers"
    answer = json.loads(answers[0])
    if "refused" in answer:
        raise MessageError(answer["refused"])


def _publish(source: random.Random, client: zenoh.Session, note: Note) -> None:
    key, kind = source.choice(sorted(MESSAGES.items()))
    label, data = mutated(cdr(kind, source, wild=source.random() < 0.5), source)
    attachment = source.choice([Tag.pack(1, 0, 5, 50), Stamp(1, source.randrange(9), 5).pack(), b""])
    if source.random() < 0.3:
        attachment = mutated(attachment, source)[1]
    note(f"{key}: {label}")
    client.put(key, data, attachment=attachment[:60_000])


def prepare(directory: Path) -> None:
    """Start the hub; a Zenoh session of this process would not work in those that are forked."""
    hub = _hub(directory)
    child = os.fork()
    if child == 0:
        code = 1
        try:
            hub.wait()
            code = 0
        finally:
            os._exit(code)
    assert os.waitpid(child, 0)[1] == 0, hub.log.read_text(encoding="utf-8")
    hub.usual_mb = hub.memory_mb()


def pristine(directory: Path) -> None:
    """Wait until the session runs, and ask it something."""
    hub = _hub(directory)
    hub.wait()
    list(_client(hub.endpoint).get(KEYS.control("clock"), timeout=20.0))


if __name__ == "__main__":
    sys.exit(search(Target(attempt, pristine, prepare, batch=500), __doc__ or "", hours=0.25))
