import numpy as np
import pytest

from controllers.teleoperation.params import TeleoperationParams
from controllers.teleoperation.pose_law import PoseLaw
from robots import rotation
from tests.controllers.teleoperation.rig import H, Session

DRIVER = "LARGE_NEEDLE_DRIVER_400006"


def stray(random, away):
    """Return how the hand goes and turns in a step: at random, and back towards where the tip started, m and
    rad.
    """
    return random.normal(0.0, 1e-4, 3) - 0.1 * away, random.normal(0.0, 2e-3, 3)


def leap(random):
    """Return where the hand is when it takes over again."""
    return np.concatenate([random.uniform(-0.3, 0.3, 3), rotation.exp(random.normal(0.0, 1.0, 3))])


def test_ten_thousand_clutch_cycles_do_not_drift():
    """The hand strays at random while it leads and leaps at random while it is free; the tip is where the led
    ways and turns add up to.
    """
    random, params = np.random.default_rng(7), TeleoperationParams(instrument=DRIVER)
    law, chain, scale, to_base = (
        PoseLaw(params.chain, turns=True),
        params.chain,
        0.3,
        np.array([0.0, 0.0, 0.0, 1.0]),
    )
    command = np.array(params.start)
    frame = home = chain.forward(command)
    there, turned = home[:3, 3].copy(), home[:3, :3].copy()
    for _ in range(10_000):
        hand = leap(random)
        tip = np.concatenate([frame[:3, 3], rotation.from_matrix(frame)])
        law.engage(hand, tip, to_base, scale)
        way, turn = stray(random, there - home[:3, 3])
        moved = np.concatenate([hand[:3] + way, rotation.product(rotation.exp(turn), hand[3:])])
        command = law.step(command, moved, tip, to_base, scale, 1e-3 * chain.velocity)
        there += scale * way
        turned = rotation.matrix(rotation.exp(turn)) @ turned
        frame = chain.forward(command)
    assert np.linalg.norm(frame[:3, 3] - there) < 1e-11
    assert np.allclose(frame[:3, :3], turned, atol=1e-11)


@pytest.mark.parametrize("orientation", ["hold", "follow"])
def test_no_clutch_makes_the_tip_jump(orientation):
    random, session = np.random.default_rng(8), Session(instrument=DRIVER, orientation=orientation, scale=0.3)
    home = session.step()
    for _ in range(300):
        way, turn = stray(random, (session.tip - home) / 0.3)
        session.hand[:3] += way
        session.turn_hand(turn)
        session.step()
        session.step([1])
        held = session.command
        session.hand[:] = leap(random)
        session.step([0])
        assert (session.command == held).all()


def test_the_command_lags_no_more_than_the_joints_must_and_catches_up():
    """A leap of the hand is followed along a straight way with one joint at its speed limit, and met; the
    last steps do not overshoot.
    """
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
    start, out = session.step(), 0.2
    hand = session.hand[2]
    for share in (*np.linspace(0.0, 1.0, 1250), *np.linspace(1.0, 0.0, 1250)):
        session.hand[2] = hand - share * out
        session.step()
        depth = session.command[2]
        assert depth <= session.chain.upper[2]
        assert abs(depth - min(0.12 + share * out, session.chain.upper[2])) < 1e-9
    assert np.allclose(session.tip, start, atol=1e-12)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_hand_that_rolls_on_past_the_limit_does_not_turn_the_tip_round(sense):
    """Roll ends at 260 degrees.

    The hand goes on for 300 more and comes back: the tip stands, then follows once it is less than 90 degrees
    behind.
    """
    start = [0.0, 0.0, 0.12, sense * 4.0, 0.0, 0.0]
    session = Session(instrument=DRIVER, orientation="follow", start=start)
    session.values["measured_js"][:6] = start
    session.step()
    limit, ahead, rolls = session.chain.upper[3], session.turn[:, 2], []
    for degree in (*[1.0] * 330, *[-1.0] * 330):
        session.turn_hand(sense * np.radians(degree) * ahead)
        session.step(count=2)
        rolls.append(sense * session.command[3])
    out, back = np.diff(rolls[:330]), np.diff(rolls[330:])
    assert (out >= -1e-9).all()
    assert max(rolls) == pytest.approx(limit)
    assert (back <= 1e-9).all()
    assert rolls[-1] == pytest.approx(limit - np.radians(330.0 - 90.0), abs=1e-6)


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
    assert session.warnings == [f"scale {scale:g} is refused, allowed is above 0 and up to 1; it stays 0.2"]


@pytest.mark.parametrize("orientation", ["hold", "follow"])
def test_an_arm_without_a_wrist_goes_the_way_of_the_hand_and_turns_as_well_as_it_can(orientation):
    session = Session(instrument="MUSHA_HAND", orientation=orientation, scale=1.0)
    start, ahead = session.step(), session.turn[:, 2]
    way, turn = np.array([0.03, -0.02, 0.01]), np.array([0.0, 0.0, 0.5])
    for _ in range(500):
        session.hand[:3] += way / 500
        session.turn_hand(turn / 500)
        session.step()
    assert np.allclose(session.tip - start, way, atol=2e-8)
    rolled = (
        rotation.log(rotation.from_matrix(session.turn @ Session(instrument="MUSHA_HAND").turn.T)) @ ahead
    )
    assert rolled == pytest.approx(0.0 if orientation == "hold" else turn @ ahead, abs=0.02)
