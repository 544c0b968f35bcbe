"""A tool on a servo presses a block in Bullet and leaves it, both engines coupled in one process.

Run as a program it prints the table of energies.
"""

import logging
import sys
from math import sqrt

import numpy as np

from engines.bullet.engine import BulletEngine
from engines.bullet.params import BulletParams
from hub.participant import MotionSide, Params, Stepped, state_hash
from hub.testing import run_in_process
from schemas.errors import TrocarError
from schemas.ports import BondSide

RADIUS, CLEARANCE, DEPTH = 5e-3, 1e-3, 4e-3
SERVO = 2000.0
"""Stiffness of the servo, N/m; its damping is critical."""
STAGES = (0.2, 0.4, 0.6)
"""Down until, held until, up until (s)."""
DURATION = 0.7
SUB_STEP = 2.5e-4


class Tool(Stepped):
    """A point mass (kg) drawn along z by its servo."""

    params_model = Params
    ports = ()

    def __init__(self, mass):
        super().__init__("tool", Params())
        self.mass = mass
        self.start = np.array([0.0, 0.0, RADIUS + CLEARANCE])

    @property
    def bonds(self):
        return (BondSide(name="tip", side="motion", dof=3, frame="world", effective_mass=self.mass),)

    def configure(self, setup):
        self.side = MotionSide(self.bonds[0], setup.bonds["tip"])
        self.x, self.v = self.start.copy(), np.zeros(3)
        return self.side.result(self.x.copy(), self.v.copy())

    def target(self, t):
        down, held, up = STAGES
        share = t / down if t < down else 1.0 if t < held else max(0.0, (up - t) / (up - held))
        return self.start - [0.0, 0.0, share * (CLEARANCE + DEPTH)]

    def step(self, t, h, inputs):
        self.side.begin(inputs, self.x, self.v)
        for i in range(round(h * 1e-9 / SUB_STEP)):
            force = self.side.force(i * SUB_STEP, self.x, self.v)
            servo = (
                SERVO * (self.target(t * 1e-9 + i * SUB_STEP) - self.x) - 2 * sqrt(SERVO * self.mass) * self.v
            )
            self.v = self.v + SUB_STEP / self.mass * (force + servo)
            self.side.add(force, SUB_STEP * self.v)
            self.x = self.x + SUB_STEP * self.v
        return self.side.result(self.x.copy(), self.v.copy())

    def state_hash(self):
        return state_hash(self.x, self.v)

    def close(self):
        pass


class Tissue(BulletEngine):
    """Remembers how much work it had received at most, J."""

    exchanged = 0.0

    def step(self, t, h, inputs):
        outputs = super().step(t, h, inputs)
        self.exchanged = max(self.exchanged, float(outputs["tip/work"][0]))
        return outputs


def cycle(mass, step_ms, algorithm, **tissue):
    """Return the energy made and the energy exchanged (J). Raises what the session raises."""
    organ = {"size": ["80 mm", "60 mm", "20 mm"], "young_modulus": "10 kPa", "nodes": 75}
    params = {
        "organs": {"block": organ},
        "probes": {"tip": {"spheres": 1, "radius": RADIUS}},
        "node_period": f"{step_ms * 4} ms",
        "sub_grid": False,
        **tissue,
    }
    engine = Tissue("tissue", BulletParams.model_validate(params))
    scenario = {
        "name": "cycle",
        "step": f"{step_ms} ms",
        "duration": f"{round(DURATION * 1e3 / step_ms) * step_ms} ms",
    }
    bond = {"motion": "tool.tip", "force": "tissue.tip", "algorithm": algorithm}
    summary = run_in_process({**scenario, "bonds": [bond]}, {"tool": Tool(mass), "tissue": engine})
    return summary.energy_residual_j, engine.exchanged


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    for algorithm in ("impulse", "impulse-linearised"):
        for mass in (0.01, 0.02, 0.05, 0.1, 0.4):
            for step_ms in (1, 2, 5):
                try:
                    made, exchanged = cycle(mass, step_ms, algorithm)
                    outcome = f"{made * 1e6:7.3f} uJ of {exchanged * 1e6:.0f} uJ: {made / exchanged:.2%}"
                except TrocarError as error:
                    outcome = f"refused: {str(error).partition(' rule ')[2].partition('(')[0]}"
                sys.stdout.write(f"{algorithm:20} {mass * 1e3:4.0f} g  {step_ms} ms  {outcome}\n")
