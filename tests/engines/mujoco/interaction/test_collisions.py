"""How instruments collide, with one another and with what stands fast: impulses since the start."""

import numpy as np
import pytest

from tests.engines.mujoco.interaction.test_rigid_contact import HEIGHT, TOUCHING, H, Rig

BOARD = {"board": {"kind": "board", "board": "surrol", "position": [0.0, 0.0, 0.0]}}
ARMS = {
    "PSM1": {"instrument": "400006", "position": [0.0, 0.0, HEIGHT], "jaw": 0.0},
    "PSM2": {"instrument": "400006", "position": [0.05, 0.0, HEIGHT], "jaw": 0.0},
}
ABOVE, DOWN = TOUCHING - 0.05, TOUCHING + 0.001


def impulses(rig):
    return {name: float(rig.outputs[f"{name}/impulse"][0]) for name in ("tools", "fixtures")}


@pytest.fixture(scope="module")
def collided():
    """PSM1 pressed onto the board, up again; then PSM2 turned against it."""
    rig = Rig(arms=ARMS, fixtures=BOARD)
    start = rig.run(0.05, PSM1=[0, 0, ABOVE, 0, 0, 0], PSM2=[0, 0, ABOVE, 0, 0, 0])
    found = [impulses(start)]
    rig.run(0.3, PSM1=[0, 0, DOWN, 0, 0, 0]).run(0.1)
    for _ in range(2):
        found.append(impulses(rig) | {"force": np.linalg.norm(rig.wrench("PSM1")[:3])})
        rig.run(0.1)
    rig.run(0.2, PSM1=[0, 0, ABOVE, 0, 0, 0])
    found.append(impulses(rig.run(0.1)))
    rig.run(0.3, PSM2=[0.5, 0, ABOVE, 0, 0, 0])
    found.append(impulses(rig.run(0.1)))
    return rig, found


def test_a_fixture_that_is_pressed_adds_force_times_time(collided):
    free, pressed, later, *_ = collided[1]
    assert free == {"tools": 0.0, "fixtures": 0.0}
    assert pressed["force"] > 0.5
    mean = 0.5 * (pressed["force"] + later["force"])
    assert later["fixtures"] - pressed["fixtures"] == pytest.approx(0.1 * mean, rel=0.05)
    assert later["tools"] == 0.0


def test_instruments_that_meet_add_to_the_other_sum(collided):
    apart, together = collided[1][-2:]
    assert together["tools"] > 0.0
    assert together["fixtures"] == apart["fixtures"]


def test_the_sums_are_state(collided):
    rig, found = collided
    state, before = rig.engine.save(), rig.engine.state_hash()
    rig.run(0.05)
    assert impulses(rig)["tools"] > found[-1]["tools"]
    rig.engine.restore(state)
    assert rig.engine.state_hash() == before
    rig.outputs = rig.engine.step(rig.now, H, rig.inputs)
    assert impulses(rig)["tools"] == pytest.approx(found[-1]["tools"], rel=0.1)


def test_a_scene_without_fixtures_has_neither_outputs_nor_state_of_them():
    with_board, without = Rig(arms=ARMS, fixtures=BOARD), Rig(arms=ARMS)
    assert not {"tools/impulse", "fixtures/impulse"} & without.outputs.keys()
    assert len(with_board.engine.save()) == len(without.engine.save()) + 2 * 8
