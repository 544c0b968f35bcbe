import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.teleoperation.controller import Teleoperation
from controllers.teleoperation.engagement import EngagementPhase
from controllers.teleoperation.params import TeleoperationParams
from hub.testing import check_engine
from robots import rotation
from robots.dvrk import psm
from robots.dvrk.instruments import instrument
from schemas.errors import StateError
from schemas.ros import BoolMessage, Joy
from schemas.vectors import VectorCodec, has_vector
from tests.controllers.teleoperation.rig import H, Session

CHAIN = psm.chain(instrument("palpation-probe"))


def test_every_output_fits_its_port_from_the_start():
    session = Session()
    for _ in range(2):
        for port in session.teleoperation.ports:
            if port.causality == "output" and port.variability == "signal" and has_vector(port.type):
                VectorCodec(port).check_vector(session.outputs[port.name])
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
    st.tuples(
        st.sampled_from(["follow", "press", "release", "both", "silent"]),
        *[st.floats(-0.2, 0.2)] * 3,
        *[st.floats(-1.5, 1.5)] * 3,
    ),
    min_size=5,
    max_size=25,
)


@given(moves, st.sampled_from(["hold", "follow"]))
def test_the_command_never_jumps(moves, orientation):
    """Whatever the hand does while it is free, the first step after moves nothing; no step is ever faster
    than the joints are.
    """
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
        away = move in ("press", "silent") or (
            away and session.teleoperation._engagement.phase is EngagementPhase.CLUTCHED
        )


PARAMS = {
    "hold": {"orientation": "hold"},
    "follow": {"orientation": "follow", "instrument": "400006"},
    "velocity": {"law": "velocity", "instrument": "400006"},
    "held": {"engage": "held", "instrument": "400006"},
    "gate": {"align": "gate", "orientation": "follow", "engage": "held"},
    "camera": {"view": "camera", "instrument": "MUSHA_HAND", "contact_period": "2 ms"},
    "table": {"planes": [{"normal": [0, 0, 1], "distance": "-113.6 mm", "stiffness": "200 N/m"}]},
}


BAD_DAYS = (
    "lead",
    "lead",
    "leap",
    "press",
    "release",
    "both",
    "silent",
    "scale",
    "view",
    "off",
    "on",
    "gripper",
)


@given(
    st.sampled_from(["hold", "follow", "velocity", "held", "gate", "camera"]),
    st.lists(st.sampled_from(BAD_DAYS), min_size=5, max_size=40),
    st.integers(0, 99),
)
def test_whatever_happens_the_arm_holds_or_follows_within_its_limits(mode, days, seed):
    """Nobody who does not follow moves; whoever takes over moves nothing in that step; nothing is faster or
    further than the joints are.
    """
    session, random, ready = Session(**PARAMS[mode]), np.random.default_rng(seed), True
    chain = session.chain
    session.step()
    follows = session.follows
    for day in days:
        session.hand[:3] += random.normal(0.0, 0.1 if day == "leap" else 1e-3, 3)
        session.turn_hand(random.normal(0.0, 1.0 if day == "leap" else 0.01, 3))
        session.twist[:] = random.normal(0.0, 0.1, 6)
        session.scale[0] = random.uniform(-0.1, 1.2) if day == "scale" else session.scale[0]
        if day == "view":
            session.values["base_in_view"][3:] = rotation.exp(random.normal(0.0, 1.0, 3))
        session.values["gripper"][0] = (
            random.uniform(-0.5, 1.5) if day == "gripper" else session.values["gripper"][0]
        )
        events = {"press": [[1, 1]], "release": [[0, 0]], "both": [[1, 0], [0, 1]]}.get(day, [])
        arm = {"off": ("PAUSED", True), "on": ("ENABLED", True)}.get(day)
        ready = ready if arm is None else arm[0] == "ENABLED"
        before = session.command
        session.measured[: len(before)] = before  # the setpoint of its controller
        session.step(*events, stale=day == "silent", arm=arm)
        moved = np.abs(session.command - before)
        assert all(np.isfinite(session.outputs[name]).all() for name in ("servo_jp", "goal_cp"))
        assert (session.command >= chain.lower).all()
        assert (session.command <= chain.upper).all()
        if ready:
            assert (moved <= chain.velocity * H * 1e-9 * (1 + 1e-9)).all()
            assert not moved.any() or (session.follows and (follows or mode == "velocity"))
        assert session.follows <= ready
        follows = session.follows


def wander(session, steps, seed):
    random = np.random.default_rng(seed)
    for _ in range(steps):
        session.hand[:3] += random.normal(0.0, 1e-4, 3)
        session.turn_hand(random.normal(0.0, 1e-3, 3))
        session.twist[:] = random.normal(0.0, 1e-2, 6)
        session.values["tip_wrench"][:3] = random.normal(0.0, 0.5, 3)
        clutch = [[[1, 0]], [[0, 1]], [], [], []][random.integers(5)]
        session.step(*clutch, stale=random.random() < 0.1)
    return session


@pytest.mark.parametrize("params", PARAMS.values(), ids=PARAMS.keys())
def test_restore_returns_to_the_same_bits(params):
    session = wander(Session(**params), 50, seed=1)
    saved, values = (
        session.teleoperation.save(),
        {name: value.copy() for name, value in session.values.items()},
    )
    expected = wander(session, 50, seed=2).teleoperation.state_hash()
    for again in (session, Session(**params)):
        again.teleoperation.restore(saved)
        for name, value in values.items():
            again.values[name][:] = value
        assert wander(again, 50, seed=2).teleoperation.state_hash() == expected


@pytest.mark.parametrize("params", PARAMS.values(), ids=PARAMS.keys())
def test_it_keeps_the_contract_of_a_controller(params):
    made = TeleoperationParams.model_validate(params)
    inputs = {
        "master": [0.1, 0.2, 0.3, 0.0, 0.6, 0.0, 0.8],
        "master_twist": [0.01, 0.0, -0.01, 0.0, 0.1, 0.0],
        "tip_wrench": [0.0, 0.1, 0.4, 0.0, 0.0, 0.0],
        "buttons": (Joy(buttons=[int(made.engage == "held"), 1]),),
    }
    check_engine(lambda: Teleoperation("teleop", made), period_ns=2 * H, inputs=inputs)


def test_a_state_of_another_size_is_refused():
    with pytest.raises(StateError, match="8 bytes"):
        Session().teleoperation.restore(bytes(8))


def test_the_hand_feels_a_plane_of_the_scenario_where_the_tip_meets_it():
    """The tip starts 0.1 mm above the plane: at scale 0.2 that is 0.5 mm of the hand, along the master's z
    that points as the arm's does.
    """
    session = Session(**PARAMS["table"], scale=0.2, force={"scale": 2.0})
    session.step()
    (plane,) = session.outputs["contact"].planes
    assert (plane.normal.x, plane.normal.y, plane.normal.z) == (0.0, 0.0, 1.0)
    assert plane.distance == pytest.approx(session.hand[2] - 0.0005, abs=1e-9)
    assert plane.stiffness == pytest.approx(2.0 * 0.2 * 200.0)
    before = plane.distance
    session.hand[:3] += [0.004, 0.0, -0.002]
    session.step(count=10)
    assert session.outputs["contact"].planes[0].distance == pytest.approx(before, abs=1e-9)
    session.step([1])
    assert session.outputs["contact"].planes == []


def test_by_the_velocity_law_the_hand_feels_what_is_ahead_of_the_tip_ahead_of_itself():
    """The tip points down onto the plane, the hand wherever it likes: the plane is met along the hand's own
    z.
    """
    session = Session(**PARAMS["table"], law="velocity", scale=0.2)
    session.hand[3:] = rotation.exp(np.array([0.4, 1.0, -0.2]))
    session.step()
    (plane,) = session.outputs["contact"].planes
    ahead = rotation.matrix(session.hand[3:])[:, 2]
    assert np.allclose([plane.normal.x, plane.normal.y, plane.normal.z], -ahead, atol=1e-12)


def test_contact_is_told_at_its_own_period():
    session = Session(**PARAMS["table"], contact_period="4 ms")
    stamps = []
    for _ in range(9):
        session.step()
        stamps.append(session.outputs["contact"].header.stamp.ns // H)
    assert stamps == [0, 0, 0, 4, 4, 4, 4, 8, 8]
    assert next(port for port in session.teleoperation.ports if port.name == "contact").period_ns == 4 * H


def test_the_arms_controller_is_told_commands_only_while_the_arm_follows():
    session = Session(instrument="400006")
    session.step()
    (command,), (jaw,) = session.outputs["PSM1/servo_jp"], session.outputs["PSM1/jaw/servo_jp"]
    assert np.array_equal(command.position, session.outputs["servo_jp"])
    assert np.array_equal(jaw.position, session.outputs["jaw/servo_jp"])
    assert command.header.stamp.ns == session.driver.time_ns
    session.step([1, 0])
    assert session.outputs["PSM1/servo_jp"] == session.outputs["PSM1/jaw/servo_jp"] == ()


def test_an_arm_that_others_move_meanwhile_is_led_on_from_there():
    session = Session(orientation="follow")
    session.step(arm=("ENABLED", True))
    session.step([1])
    session.measured[:6] = [0.3, 0.2, 0.12, 0.5, -0.4, 0.3]
    session.step(count=3)
    session.step([0])
    assert session.follows
    assert np.allclose(session.command, session.measured[:6], atol=1e-12)
    session.measured[:6] = 0.0  # what it does while it follows is its servo's business
    session.step(count=3)
    assert np.allclose(session.command, [0.3, 0.2, 0.12, 0.5, -0.4, 0.3], atol=1e-12)


def test_an_arm_without_a_controller_is_held_by_the_command():
    session = Session()
    before = (session.step(), session.command)[1]
    session.step([1])
    session.measured[:6] += 0.01  # it sags
    session.step(count=3)
    session.step([0])
    assert np.array_equal(session.command, before)


def test_a_lock_keeps_position_or_orientation_and_lets_go_without_a_jump():
    session = Session(orientation="follow", scale=1.0)
    session.step(count=5)
    start, turn = session.tip, session.turn

    def lead(**locks):
        for what, lock in locks.items():
            session.driver.send(f"lock_{what}", BoolMessage(data=lock))
        for _ in range(20):
            session.hand[:3] += [1e-5, 2e-5, -1e-5]
            session.turn_hand([1e-3, 0.0, -1e-3])
            before = session.command
            session.driver.step()
            assert (np.abs(session.command - before) <= session.chain.velocity * 1e-3).all()
        return session.tip, session.turn

    position, orientation = lead(translation=True)
    assert np.allclose(position, start, atol=1e-9)
    assert not np.allclose(orientation, turn, atol=1e-3)
    moved, kept = lead(translation=False, rotation=True)
    assert np.allclose(kept, orientation, atol=1e-9)
    assert np.allclose(moved - position, 19 * np.array([1e-5, 2e-5, -1e-5]), atol=1e-8)
    _, turned = lead(rotation=False)
    assert not np.allclose(turned, kept, atol=1e-3)


def test_a_restored_command_does_not_keep_the_pose_of_the_tip_that_it_had_before():
    session, other = Session(), Session()
    for each in (session, other):
        each.step(count=2)
    session.measured[:2] = 0.1
    session.step(arm=("PAUSED", True))
    session.teleoperation.restore(other.teleoperation.save())
    other.measured[:2] = 0.1
    for each in (session, other):
        each.step(arm=("PAUSED", True))
    assert session.teleoperation.save() == other.teleoperation.save()
