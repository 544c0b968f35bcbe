"""The authors' rule: what the ray ahead of a shut jaw meets first is attached, and released when it opens."""

from pathlib import Path

import numpy as np
import pytest

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.participant import Inputs, Setup

H = 5_000_000
FINGERS = 10.2e-3


class Rig:
    """PSM1 with its fingers `gap` (m) over the middle of a standing piece; a second piece lies below it."""

    def __init__(self, gap, instrument="400006", length=FINGERS):
        tip = 0.2 - (0.12 - 0.0065)  # of the yaw axis over the table, with the remote centre at 0.2 m
        top = tip - length - gap
        pieces = {
            f"piece{i}": {"kind": "piece", "position": [0, 0, top - 20.5e-3 * (i - 0.5)]} for i in (1, 2)
        }
        params = {
            "arms": {"PSM1": {"instrument": instrument, "position": [0, 0, 0.2], "jaw": 0.5}},
            "table": {"position": [0, 0, top - 41e-3]},
            "objects": pieces,
            "looks": False,
            "grasp": "proximity",
        }
        self.engine = MujocoEngine("robot", MujocoParams.model_validate(params))
        self.engine.configure(Setup(period_ns=H, directory=Path()))
        values = {port.name: np.array(port.start) for port in self.engine.ports if port.causality == "input"}
        self.inputs, self.joints, self.jaw, self.t = (
            Inputs(values),
            values["PSM1/servo_jp"],
            values["PSM1/jaw/servo_jp"],
            0,
        )

    def run(self, seconds):
        for _ in range(round(seconds * 1e9 / H)):
            self.out = self.engine.step(self.t, H, self.inputs)
            self.t += H
        return self

    def held(self):
        return [float(self.out[f"piece{i}/held_by"][0]) for i in (1, 2)]


def test_a_shut_jaw_holds_the_first_thing_ahead_of_it_and_an_open_one_lets_go():
    rig = Rig(gap=2e-3)
    assert rig.run(0.1).held() == [0.0, 0.0]
    rig.jaw[:] = -0.1
    assert rig.run(0.3).held() == [1.0, 0.0]
    rig.joints[2] -= 0.02
    rig.run(0.5)
    assert float(rig.out["piece1/lift"][0]) == pytest.approx(0.02, abs=1e-3)
    assert float(rig.out["piece1/slip"][0]) < 0.5e-3
    rig.jaw[:] = 0.5
    rig.run(0.5)
    assert rig.held() == [0.0, 0.0]
    assert float(rig.out["piece1/lift"][0]) < 5e-3


def test_nothing_is_held_beyond_the_ray():
    rig = Rig(gap=3.5e-3)
    rig.jaw[:] = -0.1
    assert rig.run(0.3).held() == [0.0, 0.0]


def test_the_ray_moves_along_with_longer_fingers():
    rig = Rig(gap=2e-3, instrument="400049", length=15.5e-3)
    rig.jaw[:] = -0.1
    assert rig.run(0.3).held() == [1.0, 0.0]


def test_what_is_held_is_restored_bit_for_bit():
    rig, other = Rig(gap=2e-3), Rig(gap=2e-3)
    rig.jaw[:] = -0.1
    rig.run(0.3)
    other.engine.restore(rig.engine.save())
    other.jaw[:], other.t = -0.1, rig.t
    rig.run(0.1), other.run(0.1)
    assert rig.engine.state_hash() == other.engine.state_hash()
    assert other.held() == [1.0, 0.0]
