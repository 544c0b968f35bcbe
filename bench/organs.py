"""What an organ costs by its number of nodes: the tissue engine's step of 1 ms, idle and pressed.

python bench/organs.py --json

A block of 80 x 60 x 20 mm of liver under a probe of 5 mm, 3 mm deep. Times are processor times of this
process (Bullet has one thread), so that other load on the machine counts little; compare the ratios to 250
nodes, as single times vary with the machine.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from engines.bullet.engine import BulletEngine
from engines.bullet.params import BulletParams
from hub.participant import BondPlan, Inputs, Setup

MS = 1_000_000
NODES = (100, 250, 500, 1000, 2000, 5000)
REFERENCE = 250
RADIUS_M, DEPTH_M = 5e-3, 3e-3
APPROACH_MS, PRESS_MS = 20, 100


def run(nodes: int, steps: int) -> dict[str, float]:
    """Return the mesh's size, and microseconds of a step of 1 ms idle and pressed."""
    organ = {"size": ["80 mm", "60 mm", "20 mm"], "material": "liver", "nodes": nodes}
    params = BulletParams.model_validate(
        {"organs": {"block": organ}, "probes": {"probe": {"radius": RADIUS_M}}}
    )
    mesh = params.organs["block"].rest
    with BulletEngine("tissue", params) as engine:
        engine.configure(Setup(MS, Path(), {"probe": BondPlan("velocity", mean=True)}))
        pose, twist = np.array([0.0, 0.0, RADIUS_M + 1e-3, 0.0, 0.0, 0.0, 1.0]), np.zeros(6)
        inputs = Inputs({"probe/pose": pose, "probe/twist": twist})
        t = 0

        def step(count: int) -> float:
            nonlocal t
            start = time.process_time()
            for _ in range(count):
                engine.step(t, MS, inputs)
                pose[:3] += 1e-3 * twist[:3]
                t += MS
            return (time.process_time() - start) / count * 1e6

        step(APPROACH_MS)
        idle = step(steps)
        twist[2] = -(DEPTH_M + 1e-3) / (PRESS_MS * 1e-3)
        step(PRESS_MS)
        twist[2] = 0.0
        pressed = step(steps)
    return {
        "nodes": len(mesh.nodes),
        "tetrahedra": len(mesh.tetrahedra),
        "idle_us": idle,
        "pressed_us": pressed,
    }


def measure(steps: int) -> list[dict[str, float]]:
    """Return a row for every number of nodes, with ratios to the reference."""
    rows = [run(nodes, steps) for nodes in NODES]
    reference = rows[NODES.index(REFERENCE)]
    for row in rows:
        row |= {f"{kind}_ratio": row[f"{kind}_us"] / reference[f"{kind}_us"] for kind in ("idle", "pressed")}
    return [{name: round(value, 3) for name, value in row.items()} for row in rows]


def main() -> None:
    """Measure, and print or write the result."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--output", type=Path, help="also write the JSON to this file")
    parser.add_argument("--steps", type=int, default=200, help="timed steps of each kind")
    arguments = parser.parse_args()
    rows = measure(arguments.steps)
    if arguments.output:
        arguments.output.write_text(json.dumps(rows, indent=2) + "\n")
    if arguments.json:
        print(json.dumps(rows, indent=2))
    else:
        print("  ".join(f"{name:>13}" for name in rows[0]))
        for row in rows:
            print("  ".join(f"{value:13g}" for value in row.values()))


if __name__ == "__main__":
    main()
