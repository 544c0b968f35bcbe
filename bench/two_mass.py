"""Error and stability of the coupling algorithms on two masses and a spring-damper (examples/two_mass).

Both engines run in one host; the RMS error of x1 over the communication points of 2 s is taken against the
exact solution (matrix exponential of the coupled system). With --stiff the coupling spring is 1e4 N/m, and
the largest step is sought at which the motion stays bounded (below 3 m, from a start at 1 m) over 300 steps.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

import numpy as np
from scipy.linalg import expm

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples" / "two_mass"))

from two_mass import Mass, MassParams, SprungMass

from hub.planning.wiring import make_plan
from hub.session.session import Session
from schemas.scenario import Scenario

ONE = MassParams(mass=1, stiffness=10, damping=0.1, x=1)
ALGORITHMS = {
    "jacobi": {"algorithm": "jacobi"},
    "gauss-seidel": {"algorithm": "gauss-seidel", "order": ["two", "one"]},
    "gauss-seidel, motion first": {"algorithm": "gauss-seidel", "order": ["one", "two"]},
    "impulse": {"algorithm": "impulse"},
    "impulse, slope": {"algorithm": "impulse", "prediction": "slope"},
    "impulse-linearised": {"algorithm": "impulse-linearised"},
}


class LoggedMass(Mass):
    """Mass 1, remembering its position at every communication point."""

    def step(self, t, h, inputs):
        outputs = super().step(t, h, inputs)
        self.log.append(float(self.x[0]))
        return outputs


def exact(two: MassParams, times: np.ndarray) -> np.ndarray:
    """Return x1 at `times` (s) of the coupled system."""
    ck, dk = two.coupling_stiffness, two.coupling_damping
    one = ONE
    a = np.array(
        [
            [0, 1, 0, 0],
            [-(one.stiffness + ck) / one.mass, -(one.damping + dk) / one.mass, ck / one.mass, dk / one.mass],
            [0, 0, 0, 1],
            [ck / two.mass, dk / two.mass, -(two.stiffness + ck) / two.mass, -(two.damping + dk) / two.mass],
        ]
    )
    return np.array([(expm(a * t) @ [one.x, 0, 0, 0])[0] for t in times])


def positions(coupling: dict, step_ms: float, two: MassParams, duration_s: float = 2.0) -> np.ndarray:
    """Return x1 (m) at the communication points of a run."""
    names = {"one": LoggedMass("one", ONE), "two": SprungMass("two", two)}
    names["one"].log = []
    scenario = Scenario.model_validate(
        {
            "name": f"two_mass_{os.getpid()}",
            "step": f"{step_ms} ms",
            "duration": duration_s,
            "participants": {name: {"kind": f"two_mass:{type(p).__name__}"} for name, p in names.items()},
            "bonds": [{"motion": "one.tip", "force": "two.tip", "check": "warn", **coupling}],
        }
    )
    plan = make_plan(scenario, names, dict.fromkeys(names, "engine"))
    with np.errstate(all="ignore"):
        Session(scenario, plan, names, Path.cwd(), endpoint="tcp/127.0.0.1:0").run()
    return np.array(names["one"].log)


def rms_error(coupling: dict, step_ms: float, two: MassParams) -> float:
    """Return the RMS error of x1 (m)."""
    x = positions(coupling, step_ms, two)
    return float(np.sqrt(np.mean((x - exact(two, np.arange(1, len(x) + 1) * step_ms * 1e-3)) ** 2)))


def survives(coupling: dict, step_ms: float, two: MassParams) -> bool:
    """Return whether a run stays bounded."""
    try:
        x = positions(coupling, step_ms, two, duration_s=0.3 * step_ms)
    except Exception:  # noqa: BLE001  # an unstable run ends in overflow, in whichever part notices first
        return False
    return bool(np.isfinite(x).all() and np.abs(x).max() < 3.0)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--stiff", action="store_true", help="seek the largest stable step at a coupling stiffness of 1e4 N/m"
    )
    parser.add_argument("--steps-ms", type=float, nargs="+", default=[10, 2, 1])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--output", type=Path)
    args = parser.parse_args()
    two = MassParams(
        mass=2,
        stiffness=50,
        damping=0.2,
        coupling_stiffness=1e4 if args.stiff else 100,
        coupling_damping=1,
        coupled_x=1,
    )
    rows: dict[str, dict[str, float]] = {}
    for name, coupling in ALGORITHMS.items():
        if args.stiff:
            steps = [
                s
                for s in (0.05, 0.1, 0.2, 0.5, 1, 2, 3, 5, 8, 10, 12, 14, 15, 20)
                if survives(coupling, s, two)
            ]
            rows[name] = {"largest_stable_step_ms": max(steps, default=0.0)}
        else:
            rows[name] = {f"rms_error_m_at_{h:g}_ms": rms_error(coupling, h, two) for h in args.steps_ms}
    if args.output:
        args.output.write_text(json.dumps(rows, indent=2) + "\n")
    if args.json:
        print(json.dumps(rows))
    else:
        for name, row in rows.items():
            print(f"{name:28}", "  ".join(f"{key} {value:.3g}" for key, value in row.items()))


if __name__ == "__main__":
    main()
