"""A real master of ROS 1 and real programs on rospy, each in a process of its own; see `rospy_console`."""

import json
import os
import shutil
import socket
import subprocess
import sys
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import pytest

from schemas.codec import message_type
from tests.hub.authorities import free_port
from tests.waiting import until

CONSOLE = Path(__file__).with_name("rospy_console.py")
NOETIC = "/opt/ros/noetic/lib/python3/dist-packages"


@cache
def rospy_python():
    """Return a Python that has rospy, rosmaster and the common messages, with what its environment must have;
    None if there is none.
    """
    for python, path in (
        (shutil.which("python3", path="/usr/bin"), ""),
        (shutil.which("python3", path="/usr/bin"), NOETIC),
        (sys.executable, ""),
    ):
        if python is None:
            continue
        wanted = (
            "import rospy, rosmaster, rostopic, roslib.message, sensor_msgs.msg, geometry_msgs.msg,"
            " std_msgs.msg"
        )
        if (
            subprocess.run(
                [python, "-c", wanted], env=environment(path), capture_output=True, timeout=60, check=False
            ).returncode
            == 0
        ):
            return python, path
    return None


def environment(path, **more):
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("ROS_", "PYTHON"))}
    return (
        kept
        | {"PATH": f"{kept['PATH']}:/opt/ros/noetic/bin", "PYTHONPATH": path, "ROS_IP": "127.0.0.1"}
        | more
    )


needs_rospy = pytest.mark.skipif(
    rospy_python() is None,
    reason=(
        "needs rospy: apt install python3-rospy python3-rosmaster python3-rostopic"
        " python3-{sensor,geometry,std}-msgs"
    ),
)


class Ros1:
    """A master that can be restarted at the same port, and the environment of its programs."""

    def __init__(self, directory):
        self.port = free_port()
        self.uri = f"http://127.0.0.1:{self.port}"
        python, path = rospy_python()
        self.python, self.process = python, None
        self.environment = environment(
            path,
            ROS_MASTER_URI=self.uri,
            ROS_HOME=str(directory),
            ROS_LOG_DIR=str(directory / "log"),
            TMPDIR=str(directory),  # genpy leaves directories there when its process is killed
        )

    def start(self):
        serve = (
            f"import rosmaster.master, time; rosmaster.master.Master({self.port}).start(); time.sleep(1e6)"
        )
        self.process = subprocess.Popen(
            [self.python, "-c", serve],
            env=self.environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        assert until(self._answers), "the master does not start"

    def _answers(self):
        with socket.socket() as sock:
            return sock.connect_ex(("127.0.0.1", self.port)) == 0

    def stop(self):
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            self.process = None


@contextmanager
def master(directory):
    ros = Ros1(directory)
    ros.start()
    try:
        yield ros
    finally:
        ros.stop()


class Program:
    """A console: what it is told to do, it does (`program.arm("PSM1", "home")`)."""

    def __init__(self, ros, name="console"):
        self.name = f"/{name}"
        command = [ros.python, str(CONSOLE), name]
        self.process = subprocess.Popen(
            command,
            env=ros.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def __getattr__(self, order):
        def carried_out(*arguments):
            self.process.stdin.write(json.dumps([order, *arguments]) + "\n")
            self.process.stdin.flush()
            line = self.process.stdout.readline()
            assert line, f"{self.name} has ended"
            kind, answer = json.loads(line)
            if kind == "error":
                raise RuntimeError(f"{self.name} {order}: {answer}")
            return answer

        return carried_out


class TablePeer:
    """A program as the table's exercise wants it (`crtk_table.Peer`)."""

    def __init__(self, program):
        self.program = program

    def join(self, rows):
        missing = self.program.join([(row.topic, row.type, row.way) for row in rows])
        assert not missing, f"no peer of {missing}"

    def send(self, row, message):
        self.program.send(row.topic, message.model_dump(mode="json"))

    def heard(self, row, timeout_s):
        fields = self.program.heard(row.topic, timeout_s)
        if fields is None:
            raise TimeoutError(row.topic)
        return message_type(row.type).model_validate(fields)

    def call(self, row, request):
        return message_type(f"{row.type}_Response").model_validate(
            self.program.call(row.topic, request.model_dump(mode="json"))
        )
