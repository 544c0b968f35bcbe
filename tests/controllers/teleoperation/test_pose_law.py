import numpy as np
import pytest

from robots import rotation
from tests.controllers.teleoperation.rig import H, Session

DRIVER = "LARGE_NEEDLE_DRIVER_400006"


@pytest.mark.parametrize(("orientation", "cycles"), [("hold", 1_000), ("follow", 10_000)])
def test_ten_thousand_clutch_cycles_neither_jump_nor_drift(orientation, cycles):
    """The hand strays at random while it leads and leaps at random while it is free; the tip is where the led ways add up to."""
    random = np.random.default_rng(7)
    session = Session(instrument=DRIVER, orientation=orientation, scale=0.3)
    home = session.step()
    there, turned, jump = home.copy(), session.turn.copy(), 0.0
    for _ in range(cycles):
        way, turn = random.normal(0.0, 1e-4, 3) + 0.1 * (home - there), random.normal(0.0, 2e-3, 3)
        session.hand[:3] += way
        session.turn_hand(turn)
        there += 0.3 * way
        turned = rotation.matrix(rotation.exp(turn)) @ turned if orientation == "follow" else turned
        before = session.step()
        session.step([1])
        session.hand[:3], session.hand[3:] = random.uniform(-0.3, 0.3, 3), rotation.exp(random.normal(0.0, 1.0, 3))
        jump = max(jump, np.linalg.norm(session.step([0]) - before))
    assert jump == 0.0
    assert np.linalg.norm(session.tip - there) < 1e-11
    assert np.allclose(session.turn, turned, atol=1e-11)


def test_the_command_lags_no_more_than_the_joints_must_and_catches_up():
    """A leap of the hand is followed along a straight way with one joint at its speed limit, and met; the last steps do not overshoot."""
    session = Session(scale=0.2)
    start = session.step()
    session.hand[:3] += [0.05, 0.0, -0.05]
    most, left = session.chain.velocity * H * 1e-9, []
    for _ in range(100):
        before, tip = session.command, session.tip
        session.step()
        share = np.abs((session.command - before) / most).max()
        left.append(np.linalg.norm(session.outputs["goal_cp"][:3] - session.tip))
        assert share <= 1.0 + 1e-12
        assert share > 0.999 or left[-1] < 1e-12
        move, way = session.tip - tip, session.outputs["goal_cp"][:3] - tip
        assert np.linalg.norm(np.cross(move, way)) <= 0.01 * np.linalg.norm(move) * np.linalg.norm(way)
    assert (np.diff(left) <= 1e-15).all()
    assert np.allclose(session.tip - start, [0.01, 0.0, -0.01], atol=1e-12)


def test_beyond_the_range_the_arm_waits_where_it_is_nearest_and_comes_back_with_the_hand():
    session = Session(scale=1.0)
    start, out = session.step(), 0.4
    hand = session.hand[2]
    for share in (*np.linspace(0.0, 1.0, 2500), *np.linspace(1.0, 0.0, 2500)):
        session.hand[2] = hand - share * out
        session.step()
        depth = session.command[2]
        assert depth <= session.chain.upper[2]
        assert abs(depth - min(0.12 + share * out, session.chain.upper[2])) < 1e-9
    assert np.allclose(session.tip, start, atol=1e-12)


def test_a_scale_or_a_view_that_changes_while_the_hand_moves_loses_none_of_its_way():
    session = Session(view="camera", scale=0.2, orientation="follow")
    there = session.step()
    random = np.random.default_rng(0)
    turned = session.turn.copy()
    for i in range(100):
        session.scale[0] = 0.2 + 0.1 * np.sin(i)
        session.values["base_in_view"][3:] = rotation.exp(np.array([0.0, 0.01 * i, 0.3]))
        way, turn = random.normal(0.0, 1e-4, 3), random.normal(0.0, 1e-3, 3)
        session.hand[:3] += way
        session.turn_hand(turn)
        to_base = rotation.matrix(session.teleoperation._view.hand_in_base(session.values["base_in_view"]))
        there += session.scale[0] * to_base @ way
        turned = rotation.matrix(rotation.exp(to_base @ turn)) @ turned
        session.step()
    assert np.allclose(session.tip, there, atol=1e-12)
    assert np.allclose(session.turn, turned, atol=1e-12)


@pytest.mark.parametrize("scale", [0.0, -0.2, 1.5])
def test_a_scale_that_cannot_be_is_refused_once_and_the_last_one_stays(scale):
    session = Session(scale=0.2)
    start = session.step()
    session.scale[0] = scale
    session.step(count=5)
    session.hand[0] += 0.0005
    assert np.allclose(session.step() - start, [0.0001, 0.0, 0.0], atol=1e-12)
    assert session.warnings == [f"scale {scale:g} is refused, allowed are over 0 to 1; it stays 0.2"]
