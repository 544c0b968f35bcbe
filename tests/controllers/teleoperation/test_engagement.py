import numpy as np
import pytest

from robots import rotation
from schemas.errors import TrocarError
from tests.controllers.teleoperation.rig import Session

FREE, HELD = [0], [1]


def moved(session, **step):
    """Whether the arm goes with the hand in a step."""
    before = session.command
    session.hand[:3] += 1e-4
    session.step(**step)
    return bool((session.command != before).any())


def test_it_follows_from_the_first_step_in_which_the_hand_is_heard():
    session = Session()
    session.step(stale=True, count=3)
    assert (session.states, session.follows, session.warnings) == (["DISABLED"], False, [])
    session.step()
    assert (session.states, session.follows) == (["DISABLED", "ENABLED"], True)
    assert moved(session)


def test_a_master_that_falls_silent_is_told_once_and_comes_back():
    session = Session()
    session.step()
    assert not moved(session, stale=True)
    session.step(stale=True, count=50)
    session.hand[:3] += 0.1
    held = session.command
    session.step()
    assert (session.command == held).all()
    assert moved(session)
    assert session.states == ["ENABLED", "DISABLED", "ENABLED"]
    assert session.warnings == ["PSM1 holds: its master has been silent for more than 100 ms"]


@pytest.mark.parametrize(
    "state", [("DISABLED", False), ("DISABLED", True), ("ENABLED", False), ("PAUSED", True), ("FAULT", True)]
)
def test_an_arm_that_is_not_ready_is_not_led_and_starts_from_where_it_is_when_it_is(state):
    session = Session()
    session.step()
    session.step(arm=state)
    assert not moved(session)
    session.measured[:6] = elsewhere = [0.1, 0.2, 0.15, 0.0, 0.1, -0.1]
    session.step(count=3)
    assert np.allclose(session.command, elsewhere)
    session.hand[:3] += 0.05
    session.step(arm=("ENABLED", True))
    assert np.allclose(session.command, elsewhere, atol=1e-15)
    session.measured[:6] += 0.01
    assert moved(session)
    assert np.allclose(session.command, elsewhere, atol=1e-3)
    assert session.states == ["ENABLED", "DISABLED", "ENABLED"]
    assert session.warnings == ["PSM1 holds: it is not ENABLED and homed"]


def test_held_the_arm_follows_only_while_the_button_is():
    session = Session(engage="held")
    session.step(FREE)
    assert not moved(session)
    session.step(HELD)
    assert moved(session)
    session.step(FREE)
    assert not moved(session)
    assert session.states == ["CLUTCHED", "ENABLED", "CLUTCHED"]


def test_held_a_button_that_is_told_anew_before_the_pose_is_back_counts():
    session = Session(engage="held")
    session.step(HELD)
    session.step(stale=True, count=3)
    session.step(HELD, stale=True)
    session.step(stale=True)
    held = session.command
    session.hand[:3] += 0.1
    session.step()
    assert (session.command == held).all()
    assert moved(session)


def test_held_a_master_that_comes_back_must_be_taken_hold_of_again():
    """Nobody knows what the hand did while it was not heard; a button that was down may have been let go."""
    session = Session(engage="held")
    session.step(HELD)
    session.step(stale=True)
    session.step(count=5)
    assert not moved(session)
    session.step(HELD)
    assert moved(session)
    assert session.states == ["ENABLED", "DISABLED", "CLUTCHED", "ENABLED"]
    (warning,) = session.warnings
    assert warning.endswith("silent for more than 100 ms: let go of the dead-man, and hold it again")


@pytest.mark.parametrize(("engage", "events"), [("released", [HELD, FREE]), ("held", [FREE, HELD])])
def test_a_clutch_that_is_quicker_than_a_step_still_frees_the_hand(engage, events):
    session = Session(engage=engage)
    session.step(events[-1])
    session.hand[:3] += 0.2
    held = session.command
    session.step(*events)
    assert (session.command == held).all()
    assert moved(session)


def test_another_button_may_be_the_clutch():
    session = Session(buttons={"clutch": 2})
    session.step([1, 0, 0])
    assert moved(session)
    session.step([0, 0, 1])
    assert not moved(session)


def matched(**params):
    """A session whose hand is turned as the tip is."""
    session = Session(align="gate", orientation="follow", instrument="400006", **params)
    session.hand[3:] = session.outputs["goal_cp"][3:]
    return session


def roll(session, angle):
    session.hand[3:] = rotation.product(session.hand[3:], rotation.exp(np.array([0.0, 0.0, angle])))


def tilt(session, angle):
    session.hand[3:] = rotation.product(session.hand[3:], rotation.exp(np.array([angle, 0.0, 0.0])))


def test_the_gate_opens_to_a_hand_that_matches_and_is_seen_to_be_held():
    session = matched()
    tilt(session, np.radians(30.0))
    session.step(count=10)
    assert session.states == ["ALIGNING"]
    tilt(session, np.radians(-26.0))
    session.step(count=10)
    assert session.states == ["ALIGNING"]
    roll(session, np.radians(2.5))
    session.step()
    roll(session, np.radians(-4.0))
    before = session.command
    session.step()
    assert session.states == ["ALIGNING", "ENABLED"]
    assert (session.command == before).all()


def test_a_gripper_that_opens_and_closes_shows_that_somebody_is_there():
    """From 40 degrees on or, as roll and gripper count together, from 0.8 (40 + 4) = 35.2 degrees without any
    roll.
    """
    session = matched()
    session.values["gripper"][0] = 0.2
    session.step(count=3)
    session.values["gripper"][0] = 0.2 + 35.0 / 60.0
    session.step()
    assert not session.follows
    session.values["gripper"][0] = 0.2 + 35.5 / 60.0
    session.step()
    assert session.follows


def test_after_a_clutch_the_match_must_be_closer_but_nobody_has_to_prove_that_he_is_there():
    session = matched()
    session.step()
    roll(session, 0.08)
    session.step()
    assert session.follows
    session.step([1])
    roll(session, -0.08)
    tilt(session, np.radians(4.0))
    session.step([0], count=5)
    assert session.states == ["ALIGNING", "ENABLED", "CLUTCHED", "ALIGNING"]
    tilt(session, np.radians(-2.5))
    session.step()
    assert session.follows


def test_a_hand_that_was_lost_must_show_itself_again():
    session = matched()
    session.step()
    roll(session, 0.08)
    session.step()
    session.step(stale=True)
    session.step(count=5)
    assert session.states == ["ALIGNING", "ENABLED", "DISABLED", "ALIGNING"]


def test_whoever_waits_is_told_every_two_seconds_what_to_do():
    session = matched()
    tilt(session, np.radians(30.0))
    session.step(count=4_100)
    tilt(session, np.radians(-30.0))
    session.step(count=2_000)
    turned = (
        "PSM1 waits: the master is turned 30 deg away from the instrument, allowed are 5; turn it as the"
        " instrument is"
    )
    unseen = "PSM1 waits: no hand seems to hold the master; roll it by 4 deg, or move its gripper by 40"
    assert session.warnings == [turned, turned, unseen]


@pytest.mark.parametrize(
    ("params", "problem"),
    [
        ({"align": "gate"}, "orientation: follow"),
        ({"law": "velocity", "orientation": "hold"}, "law: pose"),
        ({"law": "velocity", "instrument": "MUSHA_HAND"}, "4 joints"),
        ({"instrument": "400007x"}, "no instrument"),
        ({"start": [9, 0, 0, 0, 0, 0]}, "yaw"),
        ({"jaw": "20 deg"}, "no jaw"),
        ({"buttons": {"clutch": -1}}, "greater than or equal to 0"),
    ],
)
def test_what_makes_no_sense_is_refused(params, problem):
    with pytest.raises((ValueError, TrocarError), match=problem):
        Session(**params)
