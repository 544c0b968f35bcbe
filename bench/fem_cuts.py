"""Random cuts through tissue of kind fem, its step before and after a cut, and the cost of contact.

python bench/fem_cuts.py

Processor time in one process, the least of some turns. Results: docs/decisions/0131-cutting.md.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' rigs

from engines.tissue.meshing.grid import block
from tests.engines.fem.rig import FemRig, params
from tests.engines.fem.test_bad_days import random_cut, rest, turned_over
from tests.engines.fem.test_cut import SCALPEL, START, mass_of, strip

BLOCK = {"size": ["30 mm", "20 mm", "10 mm"], "nodes": 2000, "young_modulus": "50 kPa"}
CUTTING = {"cutting": {"toughness": "30 J/m^2"}}
COUNTS, STATED = (1000, 10_000), (100, 1000, 3000, 10_000)
TURNS, HELD_S = 5, 0.1


def cut_at_random(most: int) -> None:
    """Print mass, finite places and turned elements after random cuts."""
    random, solid = np.random.default_rng(0), strip(mesh=block(np.array([0.03, 0.02, 0.01]), 250))
    mass, elements = mass_of(solid), int((solid.elements[2] > 0.0).sum())
    for cut in range(1, most + 1):
        random_cut(random, solid)
        if cut in STATED:
            rest(solid, 0.3)
            pieces, is_finite = solid.pieces.max() + 1, bool(np.isfinite(solid.displacement).all())
            print(
                f"{cut:6} cuts: mass {mass_of(solid) / mass - 1.0:+.1e}, finite {is_finite},"
                f" turned over {turned_over(solid)}, {pieces} pieces, {elements} elements"
            )


def held(rig: FemRig) -> float:
    """Return the processor time of a step at rest, s."""
    least = float("inf")
    for _ in range(TURNS):
        start = time.process_time()
        rig.hold(HELD_S)
        least = min(least, time.process_time() - start)
    return 1e-3 * least / HELD_S


def step_of_a_cut() -> None:
    """Print the step before, while and after a blade goes through."""
    for contact in (False, True):
        with FemRig(params(BLOCK | CUTTING, SCALPEL, organ_contact=contact), START) as rig:
            before, costs = held(rig), []
            for i in range(300):
                start = time.process_time()
                rig.move(START + np.array([1e-4 * (i + 1), 0.0, 0.0]), 1e-3)
                costs.append(time.process_time() - start)
            inside, cutting = held(rig), float(np.median(costs))
            rig.move(START + np.array([0.03, 0.0, 0.05]), 0.1)
            after = held(rig)
            print(
                f"contact {contact}, {len(rig.nodes)} nodes: step {1e3 * before:.3f} ms before, while cutting"
                f" {cutting / before:.2f} of it, longest {1e3 * (max(costs) - cutting):.1f} ms more,"
                f" at rest in the cut {inside / before:.2f}, drawn out {after / before:.2f} of it"
            )


def cost_of_contact() -> None:
    """Print a step at rest with contact over one without, of one organ that touches nothing."""
    for nodes in (250, 1100, 2000):
        rigs = [FemRig(params(BLOCK | {"nodes": nodes}, organ_contact=on)) for on in (False, True)]
        costs = [min(held(rig) for _ in range(2)) for rig in rigs]
        print(f"{nodes} nodes: contact {costs[1] / costs[0] - 1.0:+.1%} of {1e3 * costs[0]:.3f} ms")
        for rig in rigs:
            rig.engine.close()


def main() -> None:
    """Print all figures."""
    cost_of_contact()
    step_of_a_cut()
    cut_at_random(COUNTS[-1] if "all" in sys.argv[1:] else COUNTS[0])


if __name__ == "__main__":
    main()
