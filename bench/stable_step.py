"""How well the stable-step rules of `hub.planning.coupling` predict the largest stable step.

In 108 linear cases for each algorithm: a tool of mass m on a servo, its virtual coupling (k, b = 2 sqrt(k
m_p)) and a proxy of mass m_p that presses on a spring make a linear system of four states. One communication
step of it, taken through the code of `hub.participant.bond`, is a matrix; the step is stable if its spectral
radius is at most 1. A rule holds in a case if the step it allows is no longer than the largest stable one.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from itertools import product
from math import sqrt
from typing import Any

import numpy as np

from hub.participant import ForceSide, Inputs, MotionSide
from hub.planning.coupling import bond_plans, stable_step_problem
from schemas.ports import BondSide
from schemas.scenario import Bond

SUB_STEP_S = 2.5e-4
STEPS_S = np.unique(np.round(np.geomspace(1, 160, 40))) * SUB_STEP_S
SERVO, SERVO_DAMPING = 400.0, 0.5
CONTACT_DAMPING = 0.3
ALGORITHMS: dict[str, dict[str, Any]] = {
    "impulse": {"algorithm": "impulse"},
    "impulse-linearised": {"algorithm": "impulse-linearised"},
    "gauss-seidel": {"algorithm": "gauss-seidel", "order": ["tissue", "tool"]},
}


@dataclass(frozen=True)
class Case:
    """Masses in kg, stiffnesses in N/m."""

    tool: float
    stiffness: float
    proxy: float
    contact: float

    @property
    def damping(self) -> float:
        """Of the virtual coupling, N s/m: critical."""
        return 2.0 * sqrt(self.stiffness * self.proxy)


CASES = [
    Case(*numbers)
    for numbers in product(
        (0.01, 0.02, 0.05, 0.15), (500.0, 2000.0, 5000.0), (0.005, 0.01, 0.02), (100.0, 330.0, 900.0)
    )
]


def sides(case: Case) -> tuple[BondSide, BondSide]:
    """Return motion side and force side as engines would declare them."""
    force = BondSide(
        name="tip",
        side="force",
        dof=1,
        stiffness=case.stiffness,
        damping=case.damping,
        proxy_mass=case.proxy,
        contact_stiffness=case.contact,
        proxy_step=SUB_STEP_S,
    )
    return BondSide(name="tip", side="motion", dof=1, effective_mass=case.tool), force


def advance(case: Case, bond: Bond, step_s: float, state: np.ndarray) -> np.ndarray:
    """Return the state (x, v of the tool, x, v of the proxy) one communication step later."""
    motion_side, force_side = sides(case)
    motion_plan, force_plan = bond_plans(bond, force_side, step_s)
    force, motion = ForceSide(force_side, force_plan), MotionSide(motion_side, motion_plan)
    x, v, p, u = (np.array([value]) for value in state)
    force.begin(Inputs({"tip/position": x, "tip/velocity": v}), step_s)
    count, h = round(step_s / SUB_STEP_S), SUB_STEP_S
    for i in range(count):
        tau = (i + 0.5) * h
        spring = case.stiffness * (force.position(tau) - p - 0.5 * h * u)
        damper = case.damping * (force.velocity(tau) - u)
        force.add(spring, damper, tau, h)
        u = (case.proxy * u + h * (spring + damper - case.contact * p)) / (case.proxy + h * CONTACT_DAMPING)
        p = p + h * u
    reaction = force.result(
        case.stiffness * (force.position(step_s) - p), case.damping * (force.velocity(step_s) - u)
    )
    motion.begin(Inputs({"tip/force": reaction["tip/force"]}), x, v)
    for i in range(count):
        push = motion.force((i + 0.5) * h, x + 0.5 * h * v, v)
        v = (case.tool * v + h * (push - SERVO * x)) / (case.tool + h * SERVO_DAMPING)
        x = x + h * v
    return np.concatenate([x, v, p, u])


def is_stable(case: Case, bond: Bond, step_s: float) -> bool:
    """Return whether no motion of the coupled system grows from step to step."""
    matrix = np.stack([advance(case, bond, step_s, unit) for unit in np.eye(4)], axis=1)
    return bool(np.isfinite(matrix).all() and np.abs(np.linalg.eigvals(matrix)).max() <= 1.0 + 1e-9)


def allowed(case: Case, bond: Bond) -> float:
    """Return the longest of the tried steps (s) that the rule lets pass, 0 if none."""
    motion, force = sides(case)
    return max(
        (step for step in STEPS_S if stable_step_problem(bond, motion, force, step) is None), default=0.0
    )


def largest_stable(case: Case, bond: Bond) -> float:
    """Return the step (s) up to which all tried ones are stable."""
    largest = 0.0
    for step in STEPS_S:
        if not is_stable(case, bond, step):
            break
        largest = float(step)
    return largest


def main() -> None:
    """Print, for each algorithm, the share of cases in which its rule holds, and its unused margin."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    figures: dict[str, dict[str, float]] = {}
    for name, coupling in ALGORITHMS.items():
        bond = Bond.model_validate({"motion": "tool.tip", "force": "tissue.tip", **coupling})
        pairs = np.array([(allowed(case, bond), largest_stable(case, bond)) for case in CASES])
        asked = pairs[pairs[:, 0] > 0]
        figures[name] = {
            "cases": len(pairs),
            "share_in_which_the_rule_holds": float((pairs[:, 0] <= pairs[:, 1]).mean()),
            "median_of_allowed_by_largest": float(
                np.median(asked[:, 0] / np.maximum(asked[:, 1], SUB_STEP_S))
            ),
        }
    if parser.parse_args().json:
        print(json.dumps(figures, indent=2))
    else:
        for name, row in figures.items():
            print(f"{name:20}", "  ".join(f"{key} {value:.3g}" for key, value in row.items()))


if __name__ == "__main__":
    main()
