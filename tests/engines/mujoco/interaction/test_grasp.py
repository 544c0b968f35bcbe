"""What jaws hold: a 0.8 mm needle and a 2 mm ring, picked up from a table, lifted and shaken."""

from pathlib import Path

import numpy as np
import pytest

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.model.objects import wire_inertia
from engines.mujoco.object_params import NeedleParams, RingParams
from engines.mujoco.params import MujocoParams
from hub.participant import Inputs, Setup
from robots.dvrk.instruments import instrument

H = 1_000_000
THICKNESS = {"needle": 0.4e-3, "ring": 1e-3}
DRIVER = instrument("400006")
RCM_HEIGHT = 0.2
# insertion at which the fingers reach the table; 6.5 mm: of the tip over the RCM at insertion 0
TOUCHING = RCM_HEIGHT - DRIVER.jaw.length + 0.0065
RADIUS = {
    "needle": NeedleParams(kind="needle", position=(0, 0, 0)).radius,
    "ring": RingParams(kind="ring", position=(0, 0, 0)).radius,
}


class Rig:
    """PSM1 over a table, with one wire under its open jaw. At home the fingers open along x."""

    def __init__(self, kind, **scene):
        place = {"kind": kind, "position": [-RADIUS[kind], 0.0, THICKNESS[kind]]}
        arm = {"instrument": "400006", "position": [0.0, 0.0, RCM_HEIGHT], "jaw": 0.5}
        params = {
            "arms": {"PSM1": arm},
            "table": {"position": [0, 0, 0]},
            "objects": {"thing": place},
            "looks": False,
            **scene,
        }
        self.engine = MujocoEngine("robot", MujocoParams.model_validate(params))
        self.outputs = self.engine.configure(Setup(period_ns=H, directory=Path()))
        values = {port.name: np.array(port.start) for port in self.engine.ports if port.causality == "input"}
        self.inputs, self.joints, self.jaw, self.step = (
            Inputs(values),
            values["PSM1/servo_jp"],
            values["PSM1/jaw/servo_jp"],
            0,
        )
        self.slip = 0.0

    def run(self, seconds, move=lambda t: None):
        for i in range(round(seconds * 1000)):
            move(i * 1e-3)
            self.outputs = self.engine.step(self.step * H, H, self.inputs)
            self.step += 1
            self.slip = max(self.slip, self.value("slip"))
        return self

    def value(self, what):
        return float(self.outputs[f"thing/{what}"][0])

    def pick_up(self):
        self.run(0.5, lambda t: self.joints.__setitem__(2, 0.12 + (TOUCHING - 0.12) * t / 0.5))
        self.jaw[:] = DRIVER.jaw.lower
        self.run(0.4)
        return self.run(0.8, lambda t: self.joints.__setitem__(2, TOUCHING - 0.05 * t))

    def shake(self, seconds):
        """5 mm to each side at 2 Hz, 3 mm to and fro at 1.5 Hz, 3 mm up and down at 3 Hz."""
        depth = self.joints[2]

        def move(t):
            grow = min(1.0, t)
            angles = (
                np.array([5.0, 3.0, 3.0])
                * 1e-3
                / [0.15, 0.15, 1.0]
                * grow
                * np.sin(2.0 * np.pi * np.array([2.0, 1.5, 3.0]) * t)
            )
            self.joints[:3] = np.add(angles, [0.0, 0.0, depth])

        return self.run(seconds, move)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["needle", "ring"])
def test_friction_alone_holds_through_lift_and_shake(kind):
    rig = Rig(kind).pick_up()
    assert rig.value("held_by") == 1.0
    rig.shake(5.0)
    assert rig.value("held_by") == 1.0
    assert rig.value("lift") > 0.03
    assert rig.slip < 1e-4


def test_a_weld_holds_while_both_fingers_touch_and_lets_go():
    rig = Rig("needle", grasp="weld").pick_up().shake(1.0)
    assert rig.slip < 5e-5
    assert rig.value("lift") > 0.03
    rig.jaw[:] = 0.8
    rig.run(0.5)
    assert rig.value("held_by") == 0.0
    assert rig.value("lift") < 1e-3


def test_a_jaw_that_is_told_to_shut_at_once_closes_at_its_speed():
    rig = Rig("ring")
    rig.jaw[:] = DRIVER.jaw.lower
    before = float(rig.outputs["PSM1/jaw/measured_js"][0])
    rig.run(0.01)
    assert before - float(rig.outputs["PSM1/jaw/measured_js"][0]) <= DRIVER.jaw.velocity * 0.01


@pytest.mark.parametrize("grasp", ["friction", "weld"])
def test_a_held_thing_is_restored_bit_for_bit(grasp):
    rig = Rig("needle", grasp=grasp).pick_up()
    saved, step, joints = rig.engine.save(), rig.step, rig.joints.copy()
    first = rig.shake(0.2).engine.state_hash()
    other = Rig("needle", grasp=grasp)
    other.engine.restore(saved)
    other.step, other.joints[:], other.jaw[:] = step, joints, DRIVER.jaw.lower
    assert other.shake(0.2).engine.state_hash() == first


@pytest.mark.parametrize("arc", [1.0, np.radians(180.9), 2.0 * np.pi])
def test_the_inertia_of_a_wire_is_that_of_its_pieces(arc):
    radius, thickness, density = 11.44e-3, 0.4e-3, 7900.0
    angles = (np.arange(20_000) + 0.5) / 20_000 * arc - arc / 2.0
    points = radius * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles])
    mass, centre, inertia = wire_inertia(radius, thickness, arc, density)
    assert mass == pytest.approx(density * np.pi * thickness**2 * radius * arc)
    assert np.allclose(points.mean(axis=1), [centre, 0.0, 0.0], atol=1e-9)
    spread = ((points - [[centre], [0.0], [0.0]]) ** 2).mean(axis=1)
    assert np.allclose(inertia, mass * (spread.sum() - spread), rtol=0.01)  # but for the thickness
