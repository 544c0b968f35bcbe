"""The force of rigid contacts on an instrument, in its arm's `rigid_wrench`."""

from pathlib import Path

import numpy as np
import pytest

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.participant import Inputs, Setup
from robots.dvrk.instruments import instrument

H = 1_000_000
GRAVITY = 9.81
HEIGHT = 0.2
DRIVER = instrument("400006")
# insertion at which the fingers reach the table; 6.5 mm: of the tip over the RCM at insertion 0
TOUCHING = HEIGHT - DRIVER.jaw.length + 0.0065
SIZE, DENSITY = (0.004, 0.006, 0.02), 5000.0


class Rig:
    def __init__(self, **scene):
        self.engine = MujocoEngine("robot", MujocoParams.model_validate({"looks": False, **scene}))
        self.outputs = self.engine.configure(Setup(period_ns=H, directory=Path()))
        self.values = {
            port.name: np.array(port.start) for port in self.engine.ports if port.causality == "input"
        }
        self.inputs, self.now = Inputs(self.values), 0

    def run(self, seconds, **joints):
        """Move the joints `<arm>: positions` there in that time."""
        commands = {f"{arm}/servo_jp": np.array(goal) for arm, goal in joints.items()}
        starts = {port: self.values[port].copy() for port in commands}
        steps = round(seconds * 1e9) // H
        for i in range(1, steps + 1):
            for port, goal in commands.items():
                self.values[port][:] = starts[port] + i / steps * (goal - starts[port])
            self.outputs = self.engine.step(self.now, H, self.inputs)
            self.now += H
        return self

    def wrench(self, arm):
        return self.outputs[f"{arm}/rigid_wrench"]


def holding(grasp):
    """PSM1 over a table, a block between its jaws, 20 mm up."""
    block = {"kind": "block", "size": SIZE, "density": DENSITY, "position": [0.0, 0.002, SIZE[2] / 2]}
    arm = {"instrument": "400006", "position": [0.0, 0.0, HEIGHT], "jaw": 1.0}
    rig = Rig(arms={"PSM1": arm}, table={"position": [0, 0, 0]}, objects={"block": block}, grasp=grasp)
    rig.run(0.5, PSM1=[0, 0, TOUCHING - 0.012, 0, 0, 0])
    rig.values["PSM1/jaw/servo_jp"][:] = 0.0
    return rig.run(0.6).run(0.5, PSM1=[0, 0, TOUCHING - 0.032, 0, 0, 0]).run(0.3)


@pytest.mark.parametrize("grasp", ["friction", "weld"])
def test_what_it_holds_pulls_with_its_weight_where_its_middle_is(grasp):
    rig = holding(grasp)
    assert rig.outputs["block/held_by"][0] == 1.0
    assert rig.outputs["block/lift"][0] > 0.015
    weight = np.array([0.0, 0.0, -np.prod(SIZE) * DENSITY * GRAVITY])
    arm = rig.outputs["block/pose"][:3] - [0.0, 0.0, HEIGHT] - rig.outputs["PSM1/measured_cp"][:3]
    assert np.allclose(rig.wrench("PSM1"), [*weight, *np.cross(arm, weight)], rtol=1e-3, atol=2e-6)


def test_nothing_touched_is_no_force_and_a_table_pushes_up_at_the_middle_of_a_probe():
    """The wrist bends along with it, so the sphere rubs a little on the table."""
    rig = Rig(
        arms={"PSM1": {"instrument": "palpation-probe", "probe_radius": 0.005, "position": [0.0, 0.0, 0.13]}},
        table={"position": [0, 0, 0]},
    )
    assert not rig.run(0.01).wrench("PSM1").any()
    # 1 mm into the table: at insertion 120 mm, the probe is 113.5 mm below the remote centre of motion
    below = [0, 0, 0.12 + 0.0125, 0, 0, 0]
    force, moment = np.split(rig.run(0.3, PSM1=below).run(0.2).wrench("PSM1"), 2)
    assert force[2] > 0.5
    assert np.linalg.norm(force[:2]) < 0.5 * force[2]
    assert np.allclose(moment, np.cross([0.0, 0.0, -0.005], force), rtol=1e-2, atol=1e-3 * force[2] * 0.005)


def test_the_last_sub_step_alone_has_the_same_motion_and_at_rest_the_same_force():
    rigs = [
        Rig(
            arms={"PSM1": {"instrument": "palpation-probe", "position": [0.0, 0.0, 0.13]}},
            table={"position": [0, 0, 0]},
            rigid_wrench=how,
            timestep="0.25 ms",
        ).run(0.2, PSM1=[0, 0, 0.12 + 0.0125, 0, 0, 0])
        for how in (True, "last")
    ]
    mean, last = (rig.wrench("PSM1").copy() for rig in rigs)
    assert last[2] > 0.5
    assert last == pytest.approx(mean, rel=0.02, abs=1e-3)
    assert rigs[0].engine.state_hash() == rigs[1].engine.state_hash()


def test_two_instruments_push_one_another_with_equal_and_opposite_wrenches():
    """Probes of 5 mm hang side by side, 12 mm apart; one base frame is turned by 90 degrees.

    PSM1 swings by 4 mm towards PSM2.
    """
    probe = {"instrument": "palpation-probe", "probe_radius": 0.005}
    rig = Rig(
        arms={
            "PSM1": probe,
            "PSM2": {
                **probe,
                "position": [0.012, 0.0, 0.0],
                "orientation": [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)],
            },
        }
    )
    rig.run(0.3, PSM1=[0.004 / 0.1135, 0, 0.12, 0, 0, 0]).run(0.1)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    first, second = rig.wrench("PSM1").reshape(2, 3), rig.wrench("PSM2").reshape(2, 3) @ turn.T
    tips = rig.outputs["PSM1/measured_cp"][:3], turn @ rig.outputs["PSM2/measured_cp"][:3] + [0.012, 0.0, 0.0]
    assert first[0][0] < -0.05
    assert np.allclose(first[0], -second[0], atol=1e-12)
    assert np.allclose(
        first[1] + np.cross(tips[0], first[0]),
        -second[1] - np.cross(tips[1], second[0]),
        atol=1e-4 * np.linalg.norm(first[0]),
    )
