"""What ROS programs get through a gateway: rates, losses, ages, and the latency of commands.

Also moves and homing in long repetition.

python -m bench.ros ros2-zenoh|ros2-dds|ros1 [bare session face live vrep servo moves cycles] [--output FILE]

`bare`: a gateway alone in a process, told joint states of two PSMs and the ECM and stereo pictures of 320 x
288 at 60 Hz; `session`: the same in a session of motion controller and MuJoCo, H = 2 ms, in real time. The
pictures are noise that nobody draws: what is measured is the gateway. `live`: the scenario `ros` as it is
shipped, with its endoscope; the console listens to the joint states of all arms and to both pictures.
`vrep`: `ros-vrep` likewise, with its joint states at 220 Hz. `servo`: from a `servo_jp` to the joint;
`moves`, `cycles`: `move_jp(...).wait()`, and unhome, disable, enable, home. The console is always a
process of its own, and its ages are from stamp to receipt (one machine, one clock). Times depend on the
machine and on who else uses it: its load stands beside.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from threading import Thread
from time import monotonic, sleep
from typing import Any

from bench.ros_addresses import PLACES, Place
from bench.ros_figures import cpu_s, host_process, percentiles
from hub.planning.scenario_file import load
from hub.session.launch import launch
from hub.session.session import Session
from hub.transport.loopback_port import LoopbackPort

HERE = Path(__file__).parent
ENDPOINT = "tcp/127.0.0.1:0"
ARMS = {
    "PSM1": {"instrument": "400006"},
    "PSM2": {"instrument": "400006"},
    "ECM": {"start": ["0 deg", "0 deg", "50 mm", "0 deg"]},
}
STATES = (
    "PSM1/measured_js",
    "PSM1/jaw/measured_js",
    "PSM2/measured_js",
    "PSM2/jaw/measured_js",
    "ECM/measured_js",
)
PICTURES = ("endoscope/left/image_raw", "endoscope/right/image_raw")
LISTENED = [[f"/{name}", "sensor_msgs/msg/JointState"] for name in STATES] + [
    [f"/{name}", "sensor_msgs/msg/Image"] for name in PICTURES
]
GATEWAY = {"arms": ARMS, "mounting": "cart"}
FAST = {"publish_period": "4545 us"}
"""220 Hz, of states that the motion controller tells at 250 Hz."""

LIVE = [
    [f"/{name}", "sensor_msgs/msg/JointState"]
    for name in (*STATES, "PSM3/measured_js", "PSM3/jaw/measured_js")
] + LISTENED[len(STATES) :]
"""What the console of `live` listens to."""
VREP = [
    [f"/dvrk/{name}", "sensor_msgs/msg/JointState"]
    for name in (
        "PSM1/state_joint_current",
        "PSM1/state_jaw_current",
        "PSM2/state_joint_current",
        "PSM2/state_jaw_current",
        "ECM/state_joint_current",
    )
] + [[f"/stereo/{eye}/image_raw", "sensor_msgs/msg/Image"] for eye in ("left", "right")]
"""What the console of `vrep` listens to."""

SCENARIO: dict[str, Any] = {
    "name": "ros_figures",
    "step": "2 ms",
    "pace": "realtime",
    "participants": {
        "motion": {"kind": "motion", "mounting": "cart", "arms": ARMS, "publish_period": "10 ms"},
        "robot": {
            "kind": "mujoco",
            "mounting": "cart",
            "arms": ARMS,
            "looks": False,
            "publish_period": "10 ms",
        },
        "ros": {"kind": "ros2-zenoh", "host": "ros", **GATEWAY},
    },
    "order": ["motion", "robot"],
    "connections": ["ros.* -> motion.*", "motion.drive/* -> robot.*", "robot.* -> motion.sense/*"],
}


class Console:
    """A ROS program in a process of its own."""

    def __init__(self, kind: str, place: Place, endpoint: str, task: str, arguments: dict[str, Any]) -> None:
        paths = [str(HERE.parent), *filter(None, [place.environment.get("PYTHONPATH")])]
        environment = place.environment | {"PYTHONPATH": os.pathsep.join(paths)}
        command = [place.python, HERE / "ros_client.py", kind, endpoint, task, json.dumps(arguments)]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )
        _expect(self.process, "ready")

    def go(self) -> None:
        _tell(self.process)

    def result(self) -> dict[str, Any]:
        return _answer(self.process)


def _expect(process: subprocess.Popen[str], word: str) -> None:
    assert process.stdout is not None
    line = process.stdout.readline()
    assert line.strip() == word, f"{process.args} said {line!r}"


def _tell(process: subprocess.Popen[str]) -> None:
    assert process.stdin is not None
    process.stdin.write("\n")
    process.stdin.flush()


def _answer(process: subprocess.Popen[str]) -> dict[str, Any]:
    assert process.stdout is not None
    return json.loads(process.stdout.readline())


def bare(kind: str, place: Place, seconds: float) -> dict[str, Any]:
    """Measure a gateway alone."""
    port = LoopbackPort("tcp/127.0.0.1:0")
    endpoint = port.endpoint
    with port.listen():
        command = [
            sys.executable,
            str(HERE / "ros_gateway_alone.py"),
            kind,
            endpoint,
            json.dumps(GATEWAY | FAST | place.params),
            str(seconds + 4.0),
        ]
        gateway = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(HERE.parent)},
        )
        _expect(gateway, "ready")
        console = Console(kind, place, endpoint, "listen", {"topics": LISTENED, "seconds": seconds})
        _tell(gateway)
        console.go()
        cost = _answer(gateway)
        console.go()
        heard = console.result()
        _tell(gateway)
        gateway.wait(10.0)
    received, told = heard.pop("received"), cost["told"]
    lost = {topic: told[topic] - received[topic] for topic, _ in LISTENED}
    return {"gateway_cpu_percent": cost["cpu_percent"], "lost_of_all": lost, "topics": heard, **_machine()}


def in_session(
    kind: str,
    place: Place,
    task: str,
    arguments: dict[str, Any],
    connections: list[str],
    parts: dict[str, Any],
    *,
    fast: bool = False,
) -> dict[str, Any]:
    """Run a session with a console and its task; states are published at 100 Hz, or 220 Hz if `fast`."""
    scenario = json.loads(json.dumps(SCENARIO))
    scenario["participants"]["ros"] |= {"kind": kind, **place.params}
    if fast:
        scenario["participants"]["ros"] |= FAST
        scenario["participants"]["motion"]["publish_period"] = "4 ms"
    scenario["participants"] |= parts
    scenario["order"] += [name for name in parts if "host" not in parts[name]]
    scenario["connections"] += connections
    with tempfile.TemporaryDirectory() as directory:
        file = Path(directory, "ros.yaml")
        file.write_text(json.dumps(scenario))
        return _with_console(launch(load(str(file)), endpoint=ENDPOINT), kind, place, task, arguments)


def _with_console(
    session: Session, kind: str, place: Place, task: str, arguments: dict[str, Any]
) -> dict[str, Any]:
    """Run a session with a console and its task."""
    result: dict[str, Any] = {}
    thread = Thread(
        target=_beside,
        args=(session, result, lambda: Console(kind, place, session.programs_endpoint, task, arguments)),
    )
    thread.start()
    summary = session.run()
    thread.join()
    result |= {
        "real_time_factor": round(summary.real_time_factor, 4),
        "steps": summary.steps,
        "late_steps": summary.late_steps,
        "observers": {name: asdict(one) for name, one in summary.observers.items()},
    }
    way = summary.latency["state to force"]
    result["hub_to_gateway_ms"] = {
        name.partition(" -> ")[2]: [round(1e3 * row[p], 2) for p in ("p50_s", "p99_s")]
        for name, row in way.items()
        if "js" in name or "image" in name
    }
    return result | _machine()


def _beside(session: Session, result: dict[str, Any], console: Callable[[], Console]) -> None:
    """Let a console do its task while a session runs, and end the session."""
    try:
        sleep(6.0)  # hosts start
        program = console()
        gateway = host_process("ros")
        program.go()
        program.go()  # ends what it listens to as soon as its time is over
        places = {"hub": "self", "gateway": gateway} | _cameras()
        before, begun = {name: cpu_s(process) for name, process in places.items()}, monotonic()
        result |= program.result()
        seconds = monotonic() - begun
        for name, process in places.items():
            result[f"{name}_cpu_percent"] = round(100 * (cpu_s(process) - before[name]) / seconds, 1)
    finally:
        session.state.shutdown()


def _cameras() -> dict[str, int]:
    """Return the process of the cameras, if there is one."""
    with suppress(LookupError):
        return {"cameras": host_process("cameras")}
    return {}


def _machine() -> dict[str, Any]:
    return {"load": Path("/proc/loadavg").read_text().split()[0], "cores": os.cpu_count()}


def session(kind: str, place: Place, seconds: float, *, everything: bool = False) -> dict[str, Any]:
    """Measure rates, losses and ages in a session.

    `everything`: publish all states of the arms, not only their joints.
    """
    parts = {"camera": {"kind": "bench.ros_participants:Pictures", "host": "cameras", "period": "16 ms"}}
    states = ["motion.* -> ros.*"] if everything else [f"motion.{name} -> ros.{name}" for name in STATES]
    connections = [
        *states,
        *(f"camera.{eye}/image_raw -> ros.endoscope/{eye}/image_raw" for eye in ("left", "right")),
    ]
    result = in_session(
        kind, place, "listen", {"topics": LISTENED, "seconds": seconds}, connections, parts, fast=True
    )
    del result["received"]
    return result


def live(
    kind: str, place: Place, seconds: float, *, scenario: str = "ros", topics: list[list[str]] = LIVE
) -> dict[str, Any]:
    """Measure a scenario as it is shipped, with its cameras."""
    changes = {"kind": kind, **place.params}
    overrides = [f"participants.ros.{name}={value}" for name, value in changes.items()]
    task = {"topics": topics, "seconds": seconds}
    return _with_console(launch(load(scenario, overrides), endpoint=ENDPOINT), kind, place, "listen", task)


def servo(kind: str, place: Place, count: int) -> dict[str, Any]:
    """Measure the way of `servo_jp` to the joint."""
    with tempfile.TemporaryDirectory() as directory:
        output = Path(directory, "times.json")
        parts = {"watch": {"kind": "bench.ros_participants:Stopwatch", "output": str(output)}}
        watched = [
            "ros.PSM1/servo_jp -> watch.servo_jp",
            "motion.drive/PSM1/servo_jp -> watch.setpoint",
            "robot.PSM1/measured_js -> watch.measured",
        ]
        result = in_session(
            kind, place, "servo", {"arm_name": "PSM1", "count": count}, ["motion.* -> ros.*", *watched], parts
        )
        return {
            f"in_session_{name}": percentiles(times) for name, times in json.loads(output.read_text()).items()
        } | result


def endless(kind: str, place: Place, task: str, count: int) -> dict[str, Any]:
    """Count hangs and missed edges."""
    return in_session(kind, place, task, {"arm_name": "PSM1", "count": count}, ["motion.* -> ros.*"], {})


def main() -> None:
    """Measure what is asked for, and print or write the result."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    measures: dict[str, Callable[[str, Place, argparse.Namespace], dict[str, Any]]] = {
        "bare": lambda kind, place, a: bare(kind, place, a.seconds),
        "session": lambda kind, place, a: session(kind, place, a.seconds),
        "face": lambda kind, place, a: session(kind, place, a.seconds, everything=True),
        "live": lambda kind, place, a: live(kind, place, a.seconds),
        "vrep": lambda kind, place, a: live(kind, place, a.seconds, scenario="ros-vrep", topics=VREP),
        "servo": lambda kind, place, a: servo(kind, place, a.pulses),
        "moves": lambda kind, place, a: endless(kind, place, "moves", a.moves),
        "cycles": lambda kind, place, a: endless(kind, place, "cycles", a.cycles),
    }
    parser.add_argument("kind", choices=PLACES)
    parser.add_argument(
        "what",
        nargs="*",
        choices=[[], *measures],
        help="all by default; `face`: as `session`, with all states published",
    )
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--pulses", type=int, default=100)
    parser.add_argument("--moves", type=int, default=1000)
    parser.add_argument("--cycles", type=int, default=200)
    parser.add_argument("--output", type=Path, help="also write the JSON to this file")
    arguments = parser.parse_args()
    os.environ["PYTHONPATH"] = os.pathsep.join(
        [str(HERE.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    )
    with PLACES[arguments.kind]() as place:
        figures = {
            name: measures[name](arguments.kind, place, arguments) for name in arguments.what or measures
        }
    text = json.dumps({arguments.kind: figures}, indent=2)
    if arguments.output:
        arguments.output.write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    main()
