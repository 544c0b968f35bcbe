"""How many first commands of ROS 2 programs over DDS are lost: rclpy on Fast DDS, at a load of 0 and of 6.

Each program has a fresh participant and publishes one command as soon as its publisher is matched: `latched`
as crtk_python_client does after `check_connections` (transient local), `once` as `ros2 topic pub --once`
(volatile, and gone 0.1 s later). Prints a table of commands received once, lost and received twice.

    python -m bench.dds_first_commands --count 200
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from devices.ros.dds.gateway import DdsGateway
from tests.devices.ros.rclpy_environment import python
from tests.devices.ros.rclpy_peer import environment, free_domain

PROGRAM = Path(__file__).parents[1] / "tests/devices/ros/dds/rclpy_first_command.py"
TOPIC = "/PSM1/state_command"
BUSY = "while True: pass"


def received_by_gateway(kind: str, count: int) -> list[str]:
    """Run `count` programs of a kind one after another; return what the gateway has received of them."""
    domain = free_domain()
    params = DdsGateway.params_model.model_validate({"arms": {"PSM1": {}}, "cameras": [], "domain": domain})
    with DdsGateway("ros", params) as gateway, tempfile.TemporaryDirectory() as directory:
        gateway.open(Path(directory))

        def read() -> list[str]:
            return [sample.message.header.frame_id for sample in gateway.read(0) if sample.port == TOPIC[1:]]

        received: list[str] = []
        program = [python(), PROGRAM, TOPIC, kind, str(count), "6"]
        with subprocess.Popen(program, env=environment(domain)) as running:
            try:
                while running.poll() is None:
                    time.sleep(0.02)
                    received += read()
            finally:
                running.kill()
        time.sleep(0.5)
        return received + read()


@contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """Keep processors busy."""
    with ExitStack() as stack:
        for _ in range(count):
            loop = stack.enter_context(subprocess.Popen([sys.executable, "-c", BUSY]))
            stack.callback(loop.kill)
        yield


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--loops", type=int, nargs="*", default=[0, 6])
    parser.add_argument("--kinds", nargs="*", default=["latched", "once"])
    wanted = parser.parse_args()
    sys.stdout.write("kind     loops  load  received  lost  twice\n")
    for loops in wanted.loops:
        for kind in wanted.kinds:
            with busy_loops(loops):
                times = Counter(received_by_gateway(kind, wanted.count))
            twice = sum(number > 1 for number in times.values())
            load = os.getloadavg()[0]
            sys.stdout.write(
                f"{kind:8} {loops:5} {load:5.1f} {len(times):9} {wanted.count - len(times):5} {twice:6}\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
