"""What a participant in the hub's process costs in a step beside its own computing.

Toy participants in a session of one process at pace `fast`, each with `ports` vectors of six numbers out and
as many in, of which `changed` get a new value in every step. The processor time of a step and participant,
less that of the same calls in a bare loop, is fitted as `a + b changed + c ports`; beside it stands the time
of a fixed reference, a dot product of seven numbers, of the same run.

    python bench/step_cost.py --json
"""

from __future__ import annotations

import argparse
import json
from time import thread_time

import numpy as np

from hub.participant import Inputs, Outputs, Params, Setup, Stepped, state_hash
from hub.testing import run_in_process
from schemas.ports import Port
from schemas.vectors import Vector

STEPS = 400
ROUNDS = 4
PARTICIPANTS = 4
CASES = ((0, 1), (1, 1), (0, 20), (5, 20), (20, 20), (0, 100), (20, 100), (100, 100))
"""Pairs (changed, ports)."""


class Toy(Stepped):
    """Gives `ports` vectors of six numbers, of which it renews the first `changed` in place."""

    def __init__(self, name: str, changed: int, ports: int) -> None:
        super().__init__(name, Params())
        self._ports = ports
        self._values = np.zeros((ports, 6))
        self._renewed = self._values[:changed]
        self._outputs: dict[str, Vector] = {f"out{i}": row for i, row in enumerate(self._values)}
        self.begun: list[float] = []
        """Processor time of the thread when each step began, s."""

    @property
    def ports(self) -> tuple[Port, ...]:
        """As many inputs as outputs."""
        inputs = (
            Port(name=f"in{i}", causality="input", size=6, start=(0.0,) * 6) for i in range(self._ports)
        )
        return (*inputs, *(Port(name=name, causality="output", size=6) for name in self._outputs))

    def configure(self, setup: Setup) -> Outputs:
        """Return zeros."""
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Renew what changes."""
        self.begun.append(thread_time())
        self._renewed += 1.0
        return self._outputs

    def state_hash(self) -> int:
        """Return the hash of one number."""
        return state_hash(self._values[0])

    def close(self) -> None:
        """Do nothing."""


def toys(changed: int, ports: int) -> dict[str, Toy]:
    """Return the participants of a case."""
    return {name: Toy(name, changed, ports) for name in (f"toy{i}" for i in range(PARTICIPANTS))}


def in_session(changed: int, ports: int) -> float:
    """Return the microseconds of a step and participant in the second half of a session."""
    made = toys(changed, ports)
    names = list(made)
    ring = zip(names, [*names[1:], names[0]], strict=True)
    scenario = {
        "name": "step_cost",
        "step": "1 ms",
        "duration": 2e-3 * STEPS,
        "order": names,
        "connections": [f"{a}.out{i} -> {b}.in{i}" for a, b in ring for i in range(ports)],
    }
    run_in_process(scenario, made)
    begun = made[names[0]].begun
    return (begun[-1] - begun[STEPS]) / (len(begun) - 1 - STEPS) / PARTICIPANTS * 1e6


def in_a_loop(changed: int, ports: int) -> float:
    """Return the microseconds of a step and participant in a bare loop."""
    made = list(toys(changed, ports).values())
    inputs = Inputs({})
    begun = thread_time()
    for t in range(STEPS):
        for toy in made:
            toy.step(t, 1, inputs)
            toy.state_hash()
    return (thread_time() - begun) / STEPS / PARTICIPANTS * 1e6


def reference() -> float:
    """Return the microseconds of a dot product of seven numbers."""
    row, count = np.ones(7), 20_000
    begun = thread_time()
    for _ in range(count):
        row.dot(row)
    return (thread_time() - begun) / count * 1e6


def measure() -> dict[str, object]:
    """Return the least cost of each case, and the fit, in microseconds and in units of the reference."""
    least = dict.fromkeys(CASES, np.inf)
    unit = np.inf
    for _ in range(ROUNDS):
        unit = min(unit, reference())
        for case in CASES:
            least[case] = min(least[case], in_session(*case) - in_a_loop(*case))
    table = np.array([(1.0, changed, ports) for changed, ports in CASES])
    fit, *_ = np.linalg.lstsq(table, np.array(list(least.values())))
    per = dict(zip(("participant", "changed_port", "port"), fit.tolist(), strict=True))
    return {
        "reference_us": round(unit, 3),
        "us": {name: round(value, 3) for name, value in per.items()},
        "references": {name: round(value / unit, 3) for name, value in per.items()},
        "cases_us": {f"{changed} of {ports}": round(value, 1) for (changed, ports), value in least.items()},
    }


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON")
    figures = measure()
    if parser.parse_args().json:
        print(json.dumps(figures, indent=2))
    else:
        print("\n".join(f"{name}: {value}" for name, value in figures.items()))


if __name__ == "__main__":
    main()
