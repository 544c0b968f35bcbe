"""Inverse kinematics of arms with the same kinematics in one call."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.motion.poses_ahead import alike
from robots.dvrk import arms
from robots.dvrk.inverse import inverse
from tests.controllers.motion.rig import CART, Rig, cp

CHAIN = arms.chain("PSM1")
PSMS = ("PSM1", "PSM2", "PSM3")
FAR = cp([0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 1.0])
POSE = [0.005, 0.01, -0.12, 1.0, 0.0, 0.0, 0.0]


@settings(max_examples=50)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 4))
def test_solutions_of_one_call_are_those_of_a_call_each_to_the_bit(seed, count):
    random = np.random.default_rng(seed)
    q, near = random.uniform(CHAIN.lower, CHAIN.upper, (2, count, len(CHAIN.joints)))
    tips = CHAIN.frames(q)[:, -1]
    alone = [inverse(CHAIN, tip, start) for tip, start in zip(tips, near, strict=True)]
    assert inverse(CHAIN, tips, near).tobytes() == np.array(alone).tobytes()


def rigs(arms=CART):
    """Return two controllers, of which the second finds joint positions for each arm by itself."""
    together, alone = Rig(arms).step(), Rig(arms).step()
    alone.motion._alike.clear()
    return together, alone


def assert_same(together, alone, orders):
    for rig in (together, alone):
        rig.step(1, **orders)
    assert together.motion.state_hash() == alone.motion.state_hash()
    assert repr(together.heard) == repr(alone.heard)


def test_arms_follow_as_they_do_alone():
    together, alone = rigs()
    random = np.random.default_rng(1)
    for i in range(60):
        shifts = {name: [*random.uniform(-2e-3, 2e-3, 3), 0, 0, 0, 0] for name in PSMS}
        orders = {
            f"{name}__servo_cp": cp(np.add(POSE, shift), f"{name}_base") for name, shift in shifts.items()
        }
        if i % 7 == 3:
            orders["PSM2__servo_cp"] = FAR
        if i % 7 == 5:
            orders["PSM1__servo_cp"] = (FAR, orders["PSM1__servo_cp"])
            orders["PSM3__hold"] = ()
        orders["ECM__servo_cp"] = FAR
        assert_same(together, alone, orders)
    moved = together.outputs["drive/PSM1/servo_jp"]
    assert not np.allclose(moved, [0, 0, 0.12, 0, 0, 0], atol=1e-4)


def test_a_base_frame_that_changes_in_the_same_step_counts():
    free = {
        name: {**arm, "position": [0.1 * i, 0.0, 0.0]}
        for i, (name, arm) in enumerate(CART.items())
        if name != "ECM"
    }
    found = [Rig(free, mounting="free", reference="world").step() for _ in range(2)]
    found[1].motion._alike.clear()
    placed = cp([0.0, 0.0, 0.01, 0.0, 0.0, 0.0, 1.0])
    orders = {f"{name}__servo_cp": cp([0.1 * i, *POSE[1:]], "world") for i, name in enumerate(PSMS)}
    assert_same(*found, orders | {"PSM2__set_base_frame": placed})


@pytest.mark.parametrize(
    ("instruments", "sizes"), [(("400006",) * 3, [3]), (("400006", "420006", "400006"), [2])]
)
def test_only_arms_with_the_same_kinematics_are_solved_together(instruments, sizes):
    rig = Rig({name: {"instrument": i} for name, i in zip(PSMS, instruments, strict=True)})
    assert [len(group) for group in alike(rig.motion._arms.values())] == sizes
