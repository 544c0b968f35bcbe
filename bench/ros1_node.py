"""The cost of a ROS 1 node that publishes many topics, ours and rospy's.

The subscriber reads and does nothing else.

    python bench/ros1_node.py --topics 60

Joint states of six joints at 100 Hz on each topic. Ours converts every message from CDR; rospy sends bytes
that are ready. Needs rospy and rosmaster.
"""

from __future__ import annotations

import argparse
import selectors
import socket
import struct
import subprocess
import sys
import tempfile
import time
import xmlrpc.client
from pathlib import Path

import numpy as np

from devices.ros.ros1.transport import Ros1Transport
from devices.ros.topics.row import Row
from schemas.codec import encode
from schemas.ros import JointState
from tests.devices.ros.helpers import until
from tests.devices.ros.rospy_peer import Ros1, master

PERIOD_S = 0.01
NUMBERS = np.full(6, 0.1)
MESSAGE = JointState(
    name=[f"joint_{index}" for index in range(6)], position=NUMBERS, velocity=NUMBERS, effort=NUMBERS
)

ROSPY = """
import io, rospy, sys, time
from sensor_msgs.msg import JointState
topics, seconds, period = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
rospy.init_node("publisher", disable_signals=True, disable_rosout=True)
names, numbers = [f"joint_{index}" for index in range(6)], [.1] * 6
message = JointState(name=names, position=numbers, velocity=numbers, effort=numbers)
ready = io.BytesIO()
message.serialize(ready)
Ready = type("Ready", (JointState,), {"serialize": lambda self, buffer: buffer.write(ready.getvalue())})
message = Ready()
publishers = [rospy.Publisher(f"/topic_{index}", JointState, queue_size=1) for index in range(topics)]
while not all(publisher.get_num_connections() for publisher in publishers):
    time.sleep(.1)
begun, used, due = time.monotonic(), time.process_time(), time.monotonic()
while time.monotonic() < begun + seconds:
    for publisher in publishers:
        publisher.publish(message)
    due += period
    time.sleep(max(0, due - time.monotonic()))
print((time.process_time() - used) / (time.monotonic() - begun), flush=True)
import os; os._exit(0)
"""


def read(ros: Ros1, topics: int) -> None:
    """Connect to every topic of `/publisher`, and read until it goes."""
    with xmlrpc.client.ServerProxy(ros.uri) as there:
        until(lambda: len(there.getPublishedTopics("/reader", "")[2]) >= topics, 20.0)
        program = xmlrpc.client.ServerProxy(there.lookupNode("/reader", "/publisher")[2])
    ears = selectors.DefaultSelector()
    for index in range(topics):
        _, host, port = program.requestTopic("/reader", f"/topic_{index}", [["TCPROS"]])[2]
        sock = socket.create_connection((host, port))
        fields = [b"callerid=/reader", b"md5sum=*", b"type=*", b"topic=/topic_%d" % index, b"tcp_nodelay=1"]
        header = b"".join(struct.pack("<I", len(field)) + field for field in fields)
        sock.sendall(struct.pack("<I", len(header)) + header)
        ears.register(sock, selectors.EVENT_READ)
    while ears.get_map():
        for key, _ in ears.select():
            try:
                gone = not key.fileobj.recv(1 << 16)  # type: ignore[union-attr]
            except OSError:
                gone = True
            if gone:
                ears.unregister(key.fileobj)


def ours(uri: str, topics: int, seconds: float) -> float:
    """Return the share of a core that our node takes."""
    node = Ros1Transport(uri, "/publisher", "127.0.0.1")
    publish = [
        node.advertise(Row(f"/topic_{index}", JointState.ros_type, "publish", periodic=True))
        for index in range(topics)
    ]
    message = encode(MESSAGE)
    while len(node._connections) < topics:
        time.sleep(0.1)
    begun, used, due = time.monotonic(), time.process_time(), time.monotonic()
    while time.monotonic() < begun + seconds:
        for each in publish:
            each(message)
        due += PERIOD_S
        time.sleep(max(0.0, due - time.monotonic()))
    share = (time.process_time() - used) / (time.monotonic() - begun)
    node.close()
    return share


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--topics", type=int, default=60)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--as", dest="role", choices=["all", "ours"], default="all", help=argparse.SUPPRESS)
    parser.add_argument("--master", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.role == "ours":
        print(ours(arguments.master, arguments.topics, arguments.seconds), flush=True)
        return
    with tempfile.TemporaryDirectory() as directory, master(Path(directory)) as ros:
        size = [str(arguments.topics), str(arguments.seconds)]
        commands = {
            "ours": (
                [
                    sys.executable,
                    __file__,
                    "--as",
                    "ours",
                    "--master",
                    ros.uri,
                    "--topics",
                    size[0],
                    "--seconds",
                    size[1],
                ],
                None,
            ),
            "rospy": ([ros.python, "-c", ROSPY, *size, str(PERIOD_S)], ros.environment),
        }
        for name, (command, environment) in commands.items():
            with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
                read(ros, arguments.topics)
                print(
                    f"{name}: {arguments.topics} topics at {1 / PERIOD_S:.0f} Hz take"
                    f" {100 * float(process.communicate()[0]):.0f} % of a core"
                )
            ros.stop()
            ros.start()


if __name__ == "__main__":
    main()
