import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers.teleoperation.engagement import Phase
from robots import rotation
from robots.dvrk import psm
from robots.dvrk.instruments import instrument
from schemas.errors import StateError
from schemas.vectors import VectorCodec, has_vector
from tests.controllers.teleoperation.rig import H, Session

CHAIN = psm.chain(instrument("palpation-probe"))


def test_every_output_fits_its_port_from_the_start():
    session = Session()
    for _ in range(2):
        for port in session.teleoperation.ports:
            if port.causality == "output" and has_vector(port.type):
                VectorCodec(port).checked(session.outputs[port.name])
        session.step()


def test_the_first_command_is_where_the_arm_is():
    session = Session()
    session.measured[:6] = [0.2, -0.1, 0.15, 0.3, 0.2, -0.2]
    session.step()
    assert np.allclose(session.outputs["servo_jp"], session.measured[:6], atol=1e-12)


def test_the_tip_moves_as_the_hand_does_but_smaller():
    session = Session(scale=0.2)
    start, way = session.step(), np.array([0.02, -0.03, -0.04])
    hand = session.hand[:3].copy()
    for share in np.linspace(0.0, 1.0, 400):
        session.hand[:3] = hand + share * way
        session.step()
        assert np.allclose(session.tip, session.outputs["goal_cp"][:3], atol=1e-8)
    session.step()
    assert np.allclose(session.tip - start, 0.2 * way, atol=1e-9)
    assert np.allclose(session.outputs["goal_cp"][:3], session.tip, atol=1e-9)


def test_registration_turns_the_way():
    session = Session(registration=rotation.exp(np.array([0.0, 0.0, np.pi / 2])).tolist())
    start = session.step()
    session.hand[0] += 0.01
    assert np.allclose(session.step(count=20) - start, [0.0, 0.002, 0.0], atol=1e-9)


def test_the_tip_keeps_its_orientation_unless_it_is_told_to_follow():
    session = Session()
    session.step()
    before = session.turn
    session.hand[3:] = rotation.exp(np.array([0.3, 0.2, 0.1]))
    session.step(count=50)
    assert np.allclose(session.turn, before, atol=1e-9)


def test_the_tip_turns_with_the_hand_by_the_same_angle_unscaled():
    registration = rotation.exp(np.array([0.4, -0.3, 1.0]))
    session = Session(orientation="follow", registration=registration.tolist())
    session.hand[3:] = rotation.exp(np.array([1.0, 0.5, -0.5]))
    session.step()
    before, turn = session.turn, np.array([0.1, 0.2, -0.15])
    session.hand[3:] = rotation.product(rotation.exp(turn), session.hand[3:])
    session.step(count=100)
    expected = rotation.matrix(rotation.exp(rotation.matrix(registration) @ turn)) @ before
    assert np.allclose(session.turn, expected, atol=1e-9)


def test_a_pressed_clutch_frees_the_hand_and_a_released_one_starts_from_where_it_is():
    session = Session()
    session.step()
    held = session.step([1])
    session.hand[:3] += 0.3
    assert (session.step(count=10) == held).all()
    assert np.allclose(session.step([0]), held, atol=1e-12)
    session.hand[2] += 0.01
    assert np.allclose(session.step(count=20) - held, [0, 0, 0.002], atol=1e-9)


def test_a_press_and_release_in_one_step_takes_the_reference_anew():
    session = Session()
    held = session.step(count=2)
    session.hand[:3] += 0.3
    assert np.allclose(session.step([1], [0]), held, atol=1e-12)


def test_a_joy_without_buttons_says_nothing_about_the_clutch():
    session = Session()
    session.step([1])
    held = session.step([])
    session.hand[:3] += 0.1
    assert (session.step(count=5) == held).all()


def test_a_silent_master_holds_the_arm_until_it_is_heard_again():
    session = Session()
    held = session.step(stale=True)
    session.hand[:3] += 0.2
    assert np.allclose(session.step(stale=True, count=20), held, atol=1e-15)
    assert np.allclose(session.step(), held, atol=1e-12)


def test_another_scale_does_not_move_the_tip():
    session = Session()
    session.step()
    session.hand[0] += 0.02
    before = session.step(count=60)
    session.scale[0] = 0.5
    assert np.allclose(session.step(), before, atol=1e-9)
    session.hand[0] += 0.01
    assert np.allclose(session.step(count=60) - before, [0.005, 0, 0], atol=1e-9)


moves = st.lists(
    st.tuples(st.sampled_from(["follow", "press", "release", "both", "silent"]), *[st.floats(-0.2, 0.2)] * 3, *[st.floats(-1.5, 1.5)] * 3),
    min_size=5,
    max_size=25,
)


@settings(max_examples=60, deadline=None)
@given(moves, st.sampled_from(["hold", "follow"]))
def test_the_command_never_jumps(moves, orientation):
    """Whatever the hand does while it is free, the first step after moves nothing; no step is ever faster than the joints are."""
    session = Session(orientation=orientation)
    session.step()
    most = CHAIN.velocity * H * 1e-9 * (1 + 1e-9)
    events = {"press": [[1]], "release": [[0]], "both": [[1], [0]]}
    away = False
    for move, *way in moves:
        before, tip = session.outputs["servo_jp"].copy(), session.tip
        session.hand[:3] = way[:3]
        session.hand[3:] = rotation.exp(np.array(way[3:]))
        session.step(*events.get(move, []), stale=move == "silent")
        assert (np.abs(session.outputs["servo_jp"] - before) <= most).all()
        assert (session.outputs["servo_jp"] >= CHAIN.lower).all()
        assert (session.outputs["servo_jp"] <= CHAIN.upper).all()
        if away or move in ("press", "both", "silent"):
            assert np.linalg.norm(session.tip - tip) < 1e-9
        away = move in ("press", "silent") or (away and session.teleoperation._engagement.phase is Phase.CLUTCHED)


def wander(session, steps, seed):
    random = np.random.default_rng(seed)
    for _ in range(steps):
        session.hand[:3] += random.normal(0.0, 1e-4, 3)
        clutch = [[[1]], [[0]], [], [], []][random.integers(5)]
        session.step(*clutch, stale=random.random() < 0.1)
    return session


@pytest.mark.parametrize("orientation", ["hold", "follow"])
def test_restore_returns_to_the_same_bits(orientation):
    session = wander(Session(orientation=orientation), 50, seed=1)
    saved, hand = session.teleoperation.save(), session.hand.copy()
    expected = wander(session, 50, seed=2).teleoperation.state_hash()
    for again in (session, Session(orientation=orientation)):
        again.teleoperation.restore(saved)
        again.hand[:] = hand
        assert wander(again, 50, seed=2).teleoperation.state_hash() == expected


def test_a_state_of_another_size_is_refused():
    with pytest.raises(StateError, match="8 bytes"):
        Session().teleoperation.restore(bytes(8))
