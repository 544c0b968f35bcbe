"""The latency from a stylus to the robot and back.

A hand in a process of its own, read at 1 kHz, leads PSM1 in MuJoCo in real time.

    python bench/latency.py --json

A hand in a process of its own, read at 1 kHz, leads PSM1 in MuJoCo. Measured end to end by the hand: from
the sample in which it has jumped to the arrival of the first pose of the tip that moves. Beside it stand the
parts that the session itself reports. On a machine with other load, `chrt -f 10` in front (Linux, as root)
shows what it would be without.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from hub.planning.scenario_file import load
from hub.session.launch import launch

HERE = Path(__file__).parent
SCENARIO = """\
name: latency_{pid}
step: {step} ms
duration: {seconds} s
pace: realtime
participants:
  hand: {{kind: "latency_hand:Tapping", host: hand, output: "{output}"}}
  teleop: {{kind: teleoperation}}
  robot:
    kind: mujoco
    host: {host}
    publish_period: {step} ms
    arms: {{PSM1: {{instrument: palpation-probe}}}}
connections:
  - hand.pose -> teleop.master
  - teleop.servo_jp -> robot.PSM1/servo_jp
  - robot.PSM1/measured_cp -> hand.state
"""


def measure(step_ms: float, seconds: float, host: str) -> dict[str, Any]:
    """Run the scene and return the percentiles, in ms."""
    os.environ["PYTHONPATH"] = os.pathsep.join([str(HERE), *filter(None, [os.environ.get("PYTHONPATH")])])
    with tempfile.TemporaryDirectory() as directory:
        file, output = Path(directory, "latency.yaml"), Path(directory, "times.json")
        file.write_text(
            SCENARIO.format(pid=os.getpid(), step=step_ms, seconds=seconds, output=output, host=host)
        )
        summary = launch(load(str(file)), endpoint="tcp/127.0.0.1:0").run()
        times_ms = np.array(json.loads(output.read_text())) / 1e6
    p50, p90, p99 = np.percentile(times_ms, [50, 90, 99])
    parts = {
        f"{way}: {stream}": [1e3 * row["p50_s"], 1e3 * row["p99_s"]]
        for way, rows in summary.latency.items()
        for stream, row in rows.items()
    }
    return {
        "jumps": times_ms.size,
        "p50_ms": p50,
        "p90_ms": p90,
        "p99_ms": p99,
        "late_steps": summary.late_steps,
        "steps": summary.steps,
        "parts_ms": parts,
    }


def main() -> None:
    """Measure, and print or write the result."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--step", type=float, default=2.0, help="communication step, ms")
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument(
        "--host", default="hub", help="where the robot runs; any other name is a process of its own"
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--output", type=Path, help="also write the JSON to this file")
    arguments = parser.parse_args()
    sys.path.append(str(HERE))
    result = measure(arguments.step, arguments.seconds, arguments.host)
    text = json.dumps(result, indent=2, default=float)
    if arguments.output:
        arguments.output.write_text(text + "\n")
    print(text if arguments.json else "\n".join(f"{name}: {value}" for name, value in result.items()))


if __name__ == "__main__":
    main()
