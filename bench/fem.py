"""Tissue of our own beside Bullet's: cost of a pressed step, and error of the force.

python bench/fem.py

A sphere of 5 mm, 3 mm deep in the middle of a block of 80 x 60 x 20 mm and 10 kPa; steps of 1 ms. Both
engines in turns in one process; processor time, the least of the turns. Truth: `bench/tissue_truth.json`.
Results: docs/decisions/0125-tissue-of-our-own.md.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' rigs

from tests.engines.bullet import rig as bullet
from tests.engines.fem import rig as fem

DEPTH_M, RADIUS_M = 3e-3, 5e-3
TRUTH = json.loads((Path(__file__).parent / "tissue_truth.json").read_text())["middle"]["force_n"]["5"][2]
TURNS, PRESSED_S = 5, 0.5
SIZES = {"bullet": (250,), "fem": (250, 600, 1100, 2000, 3300)}
RIGS = {"bullet": (bullet.Rig, bullet.params), "fem": (fem.FemRig, fem.params)}


def press(kind: str, nodes: int) -> bullet.Rig:
    """Return an engine with the sphere at rest in the block."""
    rig_class, params = RIGS[kind]
    rig = rig_class(params({**bullet.BLOCK, "nodes": nodes}, sub_grid=True))
    rig.move((0.0, 0.0, RADIUS_M - DEPTH_M), 0.1)
    rig.hold(0.2)
    return rig


def main() -> None:
    """Print the table."""
    rigs = {(kind, nodes): press(kind, nodes) for kind, sizes in SIZES.items() for nodes in sizes}
    costs = dict.fromkeys(rigs, float("inf"))
    for _ in range(TURNS):
        for key, rig in rigs.items():
            start = time.process_time()
            rig.hold(PRESSED_S)
            costs[key] = min(costs[key], (time.process_time() - start) / PRESSED_S)
    reference = costs["bullet", 250]
    for (kind, nodes), rig in rigs.items():
        cost, count = costs[kind, nodes], len(rig.nodes)
        error = rig.force[2] / TRUTH - 1.0
        print(
            f"{kind:6} {count:5} nodes: {1e3 * cost:7.1f} us a ms,"
            f" Bullet's 250 over it {reference / cost:5.1f}, force {error:+.1%}"
        )
        rig.engine.close()


if __name__ == "__main__":
    main()
