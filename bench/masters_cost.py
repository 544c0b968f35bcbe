"""What masters cost: `system` beside the same cart, arms, cameras and hands without masters and console.

python -m bench.masters_cost [--seconds 6] [--pairs 5] [--no-cameras]

Both run in turn, as fast as they can; printed are core-seconds of all processes and wall time
per simulated second, medians and their ratios.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any

import yaml

from hub.planning.scenario_file import installed_scenarios

CAMERAS = ("endoscope", "room")
OF_MASTERS = ("right_hand", "left_hand", "console", "camera", "masters")


def scenario(*, cameras: bool) -> dict[str, Any]:
    """Return `system`."""
    found: dict[str, Any] = yaml.safe_load(installed_scenarios()["system"].read_text("utf-8"))
    if not cameras:
        found = without(found, CAMERAS)
    return found


def without(found: dict[str, Any], participants: tuple[str, ...]) -> dict[str, Any]:
    """Return a scenario without participants and what connects them."""
    named = tuple(f"{name}." for name in participants)

    def stays(line: str) -> bool:
        return not any(end.startswith(named) for end in line.split(" -> "))

    return found | {
        "participants": {k: v for k, v in found["participants"].items() if k not in participants},
        "connections": [line for line in found["connections"] if stays(line)],
        "order": [name for name in found["order"] if name not in participants],
    }


def without_masters(found: dict[str, Any]) -> dict[str, Any]:
    """Return the scenario with hands that lead the teleoperations themselves."""
    left = without(found, OF_MASTERS)
    left["scene"] = left["scene"] | {
        "arms": {k: v for k, v in left["scene"]["arms"].items() if "MTM" not in k}
    }
    left["participants"]["motion"] = {"kind": "motion", "initial_state": "homed"}
    for side in ("right", "left"):
        led = left["participants"][side]
        left["participants"][side] = {k: v for k, v in led.items() if k != "align"} | {"engage": "held"}
        left["connections"] += [
            f"lead.{side}/pose -> {side}.master",
            f"lead.{side}/twist -> {side}.master_twist",
            f"lead.{side}/buttons -> {side}.buttons",
        ]
    return left


def cost(file: Path, seconds: float) -> tuple[float, float]:
    """Return core-seconds and wall time per simulated second of a run."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), monotonic()
    command = [
        sys.executable,
        "-P",
        "-m",
        "trocar",
        "run",
        str(file),
        "--set",
        f"duration={seconds} s",
        "--json",
    ]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return used, monotonic() - start


def main() -> None:
    """Run both in turn, each for a short and a long time: the difference is free of the start."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--no-cameras", action="store_true")
    given = parser.parse_args()
    whole = scenario(cameras=not given.no_cameras)
    rows: dict[str, list[tuple[float, float]]] = {"with": [], "without": []}
    with TemporaryDirectory() as scratch:
        files = {name: Path(scratch) / f"{name}.yaml" for name in rows}
        files["with"].write_text(yaml.safe_dump(whole))
        files["without"].write_text(yaml.safe_dump(without_masters(whole)))
        for _ in range(given.pairs):
            for name, file in files.items():
                short, long = cost(file, 0.2), cost(file, 0.2 + given.seconds)
                rows[name].append(tuple((b - a) / given.seconds for a, b in zip(short, long, strict=True)))
                sys.stdout.write(
                    f"{name:8} {rows[name][-1][0]:.2f} core-s, {rows[name][-1][1]:.2f} s wall per s\n"
                )
                sys.stdout.flush()
    for i, what in enumerate(("core-seconds", "wall time")):
        one, other = (median(row[i] for row in rows[name]) for name in ("with", "without"))
        sys.stdout.write(f"{what}: {one:.2f} with masters, {other:.2f} without, ratio {one / other:.2f}\n")


if __name__ == "__main__":
    main()
