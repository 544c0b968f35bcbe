"""A prescribed probe motion against a Bullet engine, and (run as a program) the state hashes of one press."""

import sys
from pathlib import Path

import numpy as np

from engines.bullet.engine import BulletEngine
from engines.bullet.params import BulletParams
from hub.participant import BondPlan, Inputs, Setup

MS = 1_000_000
BLOCK = {"size": ["80 mm", "60 mm", "20 mm"], "young_modulus": "10 kPa"}
SMALL_BLOCK = {**BLOCK, "nodes": 75}
RADIUS = 5e-3
IMPULSE = BondPlan(prediction="velocity", mean=True)


def params(block=BLOCK, probe=None, **rest):
    """Return a block and a probe that feels the force of its mesh."""
    given = {"organs": {"block": block}, "probes": {"probe": probe or {}}, "sub_grid": False}
    return BulletParams.model_validate(given | rest)


class Rig:
    """Moves the probe from `start` (m; of every sphere) on straight lines at constant speed.

    It keeps the outputs.
    """

    engine_class = BulletEngine

    def __init__(self, model=None, start=(0.0, 0.0, RADIUS + 1e-3), period=MS, plan=IMPULSE):
        self.engine = self.engine_class("tissue", model or params())
        self.period, self.t = period, 0
        self.outputs = dict(self.engine.configure(Setup(period, Path(), {"probe": plan})))
        on_frame = self.engine.params.probes["probe"].spheres is None
        position, velocity, force = (
            ("pose", "twist", "wrench") if on_frame else ("position", "velocity", "force")
        )
        self.pose = np.array([*np.ravel(start), *([0.0, 0.0, 0.0, 1.0] if on_frame else [])])
        self.twist = np.zeros(6 if on_frame else self.pose.size)
        # views
        self.at, self.speed = (
            part[: np.size(start)].reshape(np.shape(start)) for part in (self.pose, self.twist)
        )
        self.inputs = Inputs({f"probe/{position}": self.pose, f"probe/{velocity}": self.twist})
        self._force = f"probe/{force}"
        self.wrenches, self.hashes, self.power = [], [], []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.engine.close()

    def move(self, target, seconds):
        """Return the wrenches (or the forces on all spheres) of this stretch, shape (steps, 6 or 3 n)."""
        start = self.at.copy()
        way = np.asarray(target) - start
        return self.follow(lambda t: (start + way * t / seconds, way / seconds), seconds)

    def follow(self, motion, seconds):
        """Like `move`, along `motion`, which returns position (m) and velocity (m/s) at a time (s)."""
        steps = round(seconds * 1e9 / self.period)
        for i in range(steps):
            self.at[...], self.speed[...] = motion(i * self.period * 1e-9)
            self.outputs |= self.engine.step(self.t, self.period, self.inputs)
            self.t += self.period
            self.wrenches.append(self.outputs[self._force].copy())
            self.power.append(-self.wrenches[-1] @ self.twist)
            self.hashes.append(self.engine.state_hash())
        self.at[...], self.speed[...] = motion(seconds)[0], 0.0
        return np.array(self.wrenches[-steps:])

    def hold(self, seconds):
        return self.move(self.at.copy(), seconds)

    @property
    def force(self):
        """On the instrument, N, shape (3,) or (n, 3)."""
        return self.wrenches[-1][: self.at.size].reshape(self.at.shape)

    @property
    def nodes(self):
        return self.outputs["block/nodes"].nodes_m.astype(float).reshape(-1, 3)


def press_hashes():
    with Rig(params(SMALL_BLOCK)) as rig:
        rig.move((0.001, 0.0, RADIUS - 3e-3), 0.1)
        rig.hold(0.1)
        return rig.hashes


if __name__ == "__main__":
    sys.stdout.write(" ".join(f"{value:016x}" for value in press_hashes()))
