"""A gateway alone in a process, with states and pictures written to it at the given rates.

`bench/ros.py` compares it with a whole session.

    python bench/ros_gateway_alone.py KIND ENDPOINT '{"...": ...}' SECONDS

Says `ready` once the gateway is open, waits for a line, tells for so many seconds, and then prints what it
has cost and how many messages it has sent.
"""

from __future__ import annotations

import json
import sys
from functools import partial
from pathlib import Path
from threading import Thread
from time import monotonic, sleep
from typing import Any

import numpy as np

from bench.ros_figures import cpu_s
from bench.ros_participants import EYES, picture
from devices.ros.gateway import Gateway
from hub.planning.session_parameters import SessionParameters
from hub.transport.zenoh_session import open_session
from schemas.files import Files
from schemas.trocar_msgs import GatewayStatus
from schemas.vectors import VectorCodec

TELL_S, PICTURE_S = 4e-3, 1 / 60
"""Joint states come at 250 Hz, for a gateway that publishes them at 220 Hz."""


def every(period_s: float, until: float, do: Any) -> None:
    due = monotonic()
    while due < until:
        sleep(max(due - monotonic(), 0.0))
        do()
        due += period_s


def main() -> None:
    kind, endpoint, params, seconds = sys.argv[1:5]
    parameters = SessionParameters({"ros": kind}, {"ros": json.loads(params)}, (), Files(Path.cwd()))
    gateway, _ = parameters.make("ros")
    assert isinstance(gateway, Gateway)
    gateway.learn_hub(partial(open_session, "client", connect=[endpoint]))
    gateway.open(Path.cwd())
    states = [
        (row.port.name, VectorCodec(row.port).neutral)
        for row in gateway.rows
        if row.port and row.periodic and row.name.endswith("measured_js")
    ]
    pictures = [picture(number) for number in range(8)]
    numbers = np.zeros(1)

    def tell() -> None:
        numbers[:] += 1e-6
        for name, neutral in states:
            gateway.write(name, neutral + numbers)

    def show() -> None:
        for eye in EYES:
            gateway.write(f"endoscope/{eye}/image_raw", pictures[0])

    print("ready", flush=True)
    sys.stdin.readline()
    until = monotonic() + float(seconds)
    telling, showing = (
        Thread(target=every, args=(TELL_S, until, tell)),
        Thread(target=every, args=(PICTURE_S, until, show)),
    )
    begun, spent = monotonic(), cpu_s()
    telling.start()
    showing.start()
    while monotonic() < until:
        list(gateway.read(0))
        sleep(2e-3)
    cpu = (cpu_s() - spent) / (monotonic() - begun)
    telling.join()
    showing.join()
    sleep(1.5)  # a state is published for a second after it was told last
    (status,) = [said.message for said in gateway.read(10**18) if isinstance(said.message, GatewayStatus)]
    print(
        json.dumps(
            {
                "cpu_percent": round(100 * cpu, 1),
                "told": {topic.topic: topic.messages for topic in status.topics},
            }
        ),
        flush=True,
    )
    sys.stdin.readline()
    gateway.close()


if __name__ == "__main__":
    main()
