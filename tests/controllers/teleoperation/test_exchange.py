"""A hand that leads an arm whose instrument is exchanged."""

import numpy as np
import pytest

from robots.dvrk import psm
from robots.dvrk.instruments import instrument
from tests.controllers.teleoperation.rig import Session

APPLIER, SCISSORS, HOOK = (psm.chain(instrument(number)) for number in ("420327", "400007", "400183"))
ARMS = {"PSM1": {"instrument": "420327", "spares": ["400007", "400183"]}}


@pytest.fixture
def session():
    made = Session(arms=ARMS, orientation="follow", start=[0.1, -0.1, 0.12, 0.2, 0.3, -0.2])
    made.measured[:6] = [0.1, -0.1, 0.12, 0.2, 0.3, -0.2]
    made.values["gripper"][0] = 1.0
    made.step(arm=("ENABLED", True), count=5)
    return made


def exchange(session, number):
    """Let the arm get an instrument; it comes in elsewhere."""
    session.values["instrument"][0] = -1.0
    session.step(count=3)
    session.measured[:6] = [0.1, -0.1, 0.1, 0.2, 0.0, 0.0]
    session.step()
    session.values["instrument"][0] = number
    return session.step()


def test_the_arm_holds_during_an_exchange_and_says_why(session):
    assert session.follows
    session.values["instrument"][0] = -1.0
    session.step()
    assert not session.follows
    assert session.warnings == ["PSM1 holds: its instrument is exchanged"]
    assert session.driver.sent.get("PSM1/servo_jp", ()) == ()


def test_the_hand_goes_on_with_the_tip_of_the_new_instrument(session):
    exchange(session, 1.0)
    assert session.follows
    start = SCISSORS.forward(session.measured[:6])
    np.testing.assert_allclose(session.outputs["servo_jp"], session.measured[:6], atol=1e-12)
    np.testing.assert_allclose(session.outputs["goal_cp"][:3], start[:3, 3], atol=1e-12)
    way, hand = np.array([0.01, -0.02, -0.01]), session.hand[:3].copy()
    for share in np.linspace(0.0, 1.0, 300):
        session.hand[:3] = hand + share * way
        session.step()
    session.step()
    moved = SCISSORS.forward(session.outputs["servo_jp"])[:3, 3] - start[:3, 3]
    np.testing.assert_allclose(moved, session.params.scale * way, atol=1e-8)
    wrong = APPLIER.forward(session.outputs["servo_jp"])[:3, 3] - start[:3, 3]
    assert np.linalg.norm(wrong - moved) > 1e-3


def test_a_rigid_instrument_gets_no_command_of_a_jaw(session):
    assert session.driver.sent["PSM1/jaw/servo_jp"]
    exchange(session, 2.0)
    session.step()
    assert session.driver.sent["PSM1/servo_jp"]
    assert session.driver.sent.get("PSM1/jaw/servo_jp", ()) == ()


def test_clips_close_with_the_clip_applier_alone(session):
    def shut():
        sent = 0
        for gripper in (1.0, 0.0):
            session.values["gripper"][0] = gripper
            for _ in range(2500):
                session.step()
                sent += len(session.driver.sent.get("clip", ()))
        return sent

    assert shut() == 1
    exchange(session, 1.0)
    assert shut() == 0
    exchange(session, 0.0)
    assert shut() == 1


def test_a_saved_state_has_the_instrument(session):
    exchange(session, 1.0)
    saved = session.teleoperation.save()
    tip = session.outputs["goal_cp"].copy()
    exchange(session, 0.0)
    session.teleoperation.restore(saved)
    session.values["instrument"][0] = 1.0
    session.step()
    np.testing.assert_allclose(session.outputs["goal_cp"], tip, atol=1e-12)


def test_an_arm_without_spares_has_no_port_for_it():
    assert "instrument" not in {port.name for port in Session().teleoperation.ports}
