"""Cost of a patient's tissue beside a single organ with as many nodes.

python bench/fem_anatomy.py [PATIENT]

Steps of 1 ms, all in turns in one process; processor time, the least of the turns. Results:
docs/decisions/0148-stiff-tubes.md.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' rigs

from engines.fem.params import FemParams
from tests.engines.fem.rig import FemRig

FAR = np.array([[0.0, -0.2, 0.2], [0.0, -0.2, 0.21]])
PROBES = {"probe": {"spheres": 2, "radius": "1 mm", "clip": {}}}
TURNS, HELD_S = 3, 0.05


def patient(number: int, *, own: bool, added: bool) -> FemRig:
    """Return a patient at rest. `own`: own sub-steps; `added`: the patient's inertia."""
    given: dict[str, Any] = {"anatomy": {"patient": number, "phase": "clip-and-cut"}, "probes": PROBES}
    names = FemParams.model_validate(given).organs
    light = {} if added else {name: {"inertia": 1.0} for name in names}
    return FemRig(FemParams.model_validate({**given, "organs": light, "own_sub_steps": own}), FAR)


def block(nodes: int) -> FemRig:
    """Return a single organ that may be cut."""
    organ = {"size": ["90 mm", "80 mm", "40 mm"], "nodes": nodes, "material": "liver", "cutting": {}}
    return FemRig(FemParams.model_validate({"organs": {"block": organ}, "probes": PROBES}), FAR)


def main() -> None:
    """Print the table."""
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 7
    rigs = {
        "neither": patient(number, own=False, added=False),
        "own sub-steps": patient(number, own=True, added=False),
        "inertia": patient(number, own=False, added=True),
        "both": patient(number, own=True, added=True),
    }
    nodes = sum(len(organ.nodes) for organ in rigs["both"].engine._organs)
    rigs["single block"] = block(nodes)
    costs = dict.fromkeys(rigs, float("inf"))
    for _ in range(TURNS):
        for name, rig in rigs.items():
            start = time.process_time()
            rig.hold(HELD_S)
            costs[name] = min(costs[name], (time.process_time() - start) / HELD_S)
    for name, rig in rigs.items():
        steps, share = rig.engine._sub_steps, costs[name] / costs["single block"]
        print(
            f"{name:14} {nodes} nodes, {steps:3} sub-steps: {costs[name]:6.2f} ms a ms, {share:5.1f} blocks"
        )
        rig.engine.close()


if __name__ == "__main__":
    main()
