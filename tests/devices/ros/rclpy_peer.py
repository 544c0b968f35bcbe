"""Leads a program on real rclpy (`rclpy_console`) in a process of its own."""

import json
import os
import signal
import socket
import subprocess
from pathlib import Path

from schemas.codec import message_type

CONSOLE = Path(__file__).parent / "rclpy_console.py"


def free_domain():
    """Return a domain in which nobody is; it is taken a moment later, so each worker has ten of its own."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % 10
    for domain in range(1 + 10 * worker, 11 + 10 * worker):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as first:
            try:
                first.bind(("", 7400 + 250 * domain + 10))  # what the first participant listens to
            except OSError:
                continue
            return domain
    raise RuntimeError("somebody is in all domains")


def environment(domain, discovery="LOCALHOST"):
    """Return the variables of a ROS program in a domain on this machine."""
    return {
        "PATH": os.environ["PATH"],
        "HOME": os.environ["HOME"],
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": discovery,
    }


class RclpyPeer:
    """A program as the table's exercise wants it."""

    def __init__(self, python, domain, name="console", **settings):
        self.process = subprocess.Popen(
            [python, CONSOLE, name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment(domain, **settings),
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGCONT)
        try:
            self.process.communicate(timeout=60.0)  # the end of its input is the end of it
        finally:
            self.process.kill()

    def do(self, what, **order):
        self.process.stdin.write(json.dumps({"do": what, **order}) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline() or '"the console has died"')

    def join(self, rows, timeout_s=60.0):
        assert (
            self.do(
                "join", rows=[(row.topic, row.type, row.way, row.latched) for row in rows], timeout=timeout_s
            )
            == []
        )

    def send(self, row, message, times=1):
        self.do("send", topic=row.topic, message=plain(message), times=times)

    def heard(self, row, timeout_s):
        answer = self.do("heard", topic=row.topic, timeout=timeout_s)
        if answer is None:
            raise TimeoutError(row.topic)
        return message_type(row.type).model_validate(answer)

    def call(self, row, request, timeout_s=60.0):
        answer = self.do("call", topic=row.topic, request=plain(request), timeout=timeout_s)
        if answer is None:
            raise TimeoutError(row.topic)
        return message_type(f"{row.type}_Response").model_validate(answer)


def plain(message):
    # that of an empty message has no name in rclpy
    return json.loads(message.model_dump_json(exclude={"structure_needs_at_least_one_member"}))
