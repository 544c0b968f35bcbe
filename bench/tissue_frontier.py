"""How many nodes of an organ run in real time: cost and force of the tissue engine at several resolutions.

python bench/tissue_frontier.py --json

An organ is pressed at its highest free point by a sphere of 5 mm, 3 mm deep, with the longest sub-step that
its mesh allows for forces, 1.7 / w (docs/decisions/0015-contact-force.md), of 1, 0.5 and 0.25 ms, and without
gravity. `real_time`: simulated time by processor time of the engine alone, idle and pressed; `loops`: the
same processor time in units of a loop of plain Python, timed before and after, so that machines and loads can
be compared. `truth_error`: of the force at rest, to finite elements of the same mesh. Results:
docs/decisions/0046-cost-of-tissue.md and 0050-faster-tissue.md.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' truth and rig

from engines.bullet.params import BulletParams
from engines.tissue.frequencies import highest_frequency
from schemas.vectors import Vector
from tests.engines.bullet.finite_elements import Body
from tests.engines.bullet.rig import Rig

NODES = (75, 150, 250, 500, 1000)
ORGANS: dict[str, dict[str, object]] = {
    "block": {"size": ["80 mm", "60 mm", "20 mm"], "young_modulus": "10 kPa"},
    "kidney": {"shape": "kidney-with-adrenal"},
    "colon": {"shape": "colon"},
    "liver": {"shape": "liver-lobe"},
}
RADIUS_M, DEPTH_M = 5e-3, 3e-3
CLEAR_M = 15e-3
"""Least distance of the point that is pressed from anchored nodes."""
REST_S = {"block": 0.2, "kidney": 0.2, "colon": 0.2, "liver": 2.0}
"""After the press, until the force is that at rest: the liver is tied at one end and swings slowly."""
LARGEST_PHASE = 1.7
"""Sub-step times highest frequency up to which forces keep their figure."""
SUB_STEPS_S = (1e-3, 0.5e-3, 0.25e-3)
LOOP = 100_000
"""Turns of the reference loop."""


def model(organ: dict[str, object], nodes: int) -> BulletParams:
    """Return the organ of about so many nodes, with its probe and the sub-step that suits it."""
    part = {**organ, "nodes": nodes}
    params = BulletParams.model_validate(
        {"organs": {"organ": part}, "probes": {"probe": {"radius": RADIUS_M}}, "sub_grid": False}
    )
    there = params.organs["organ"]
    tied = np.any(list(there.anchored_nodes.values()), axis=0)
    frequency = highest_frequency(there.rest, np.where(tied, 0.0, 1.0), there.elastic)
    step = next((s for s in SUB_STEPS_S if s * frequency <= LARGEST_PHASE), SUB_STEPS_S[-1])
    return params.model_copy(update={"timestep": round(step * 1e9), "gravity": 0.0})


def highest(params: BulletParams) -> Vector:
    """Return the highest node far from anchors, m, shape (3,): as near to one place as the mesh has one."""
    organ = params.organs["organ"]
    nodes, tied = organ.rest.nodes, np.any(list(organ.anchored_nodes.values()), axis=0)
    away = np.linalg.norm(nodes[:, None] - nodes[tied], axis=2).min(axis=1)
    free = nodes[away >= CLEAR_M]
    top = free[free[:, 2] > free[:, 2].max() - 1e-6]
    return top[np.linalg.norm(top[:, :2], axis=1).argmin()]


def loop_s() -> float:
    """Return the processor time (s) of the reference loop."""
    start = time.process_time()
    sum(i * i for i in range(LOOP))
    return time.process_time() - start


def run(name: str, nodes: int, seconds: float) -> dict[str, float | str]:
    """Return one row."""
    params = model(ORGANS[name], nodes)
    at, mesh = highest(params), params.organs["organ"].rest
    above = np.array([0.0, 0.0, RADIUS_M])
    row: dict[str, float | str] = {
        "organ": name,
        "nodes": len(mesh.nodes),
        "tetrahedra": len(mesh.tetrahedra),
    }
    row["timestep_ms"] = params.sub_step * 1e-6
    with Rig(params, start=at + above + [0.0, 0.0, 1e-3]) as rig:

        def cost(kind: str) -> None:
            loop = loop_s()
            start = time.process_time()
            rig.hold(seconds)
            spent = time.process_time() - start
            row[f"{kind}_real_time"] = seconds / spent
            row[f"{kind}_loops"] = spent / seconds / (0.5 * (loop + loop_s()))

        cost("idle")
        rig.move(at + above - [0.0, 0.0, DEPTH_M], 0.1)
        rig.hold(REST_S[name])
        cost("pressed")
        row["force_n"] = float(rig.force[2])
    truth = Body(params.organs["organ"], gravity=0.0).press([at + above - [0.0, 0.0, DEPTH_M]], [RADIUS_M])[
        0, 2
    ]
    row["truth_error"] = float(rig.force[2] / truth - 1.0)
    return row


def main() -> None:
    """Print a row for every organ and resolution, as it is found; or all as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--organs", nargs="+", choices=list(ORGANS), default=list(ORGANS), metavar="ORGAN")
    parser.add_argument(
        "--nodes", nargs="+", type=int, default=list(NODES), help="numbers of nodes asked for"
    )
    parser.add_argument("--seconds", type=float, default=0.2, help="timed simulated time of each kind")
    arguments = parser.parse_args()
    rows: list[dict[str, float | str]] = []
    for name in arguments.organs:
        for nodes in arguments.nodes:
            rows.append(run(name, nodes, arguments.seconds))
            if not arguments.json:
                print("  ".join(f"{key} {_short(value)}" for key, value in rows[-1].items()), flush=True)
    if arguments.json:
        print(json.dumps(rows, indent=2))


def _short(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.3g}"


if __name__ == "__main__":
    main()
