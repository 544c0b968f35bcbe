"""A clip applier in the hand: when a clip closes."""

import numpy as np
import pytest

from tests.controllers.teleoperation.rig import Session

APPLIER = "420327"


def clips(session, gripper, count):
    """Return how many clips close in `count` steps of 1 ms."""
    session.driver.set("gripper", [gripper])
    found = 0
    for _ in range(count):
        session.step()
        found += len(session.driver.sent.get("clip", ()))
    return found


def test_each_closing_of_the_jaw_closes_one_clip():
    session = Session(instrument=APPLIER, engage="held", jaw="0 deg")
    session.step([1, 0])
    assert clips(session, 0.0, 500) == 0, "the jaw was never opened"
    assert clips(session, 1.0, 2000) == 0
    assert clips(session, 0.0, 2000) == 1
    assert clips(session, 0.5, 500) == 0
    assert clips(session, 0.0, 500) == 0, "not opened wide"
    assert clips(session, 1.0, 500) == 0
    assert clips(session, 0.0, 500) == 1


def test_a_clip_closes_only_while_the_arm_follows_and_once_the_jaw_has_arrived():
    session = Session(instrument=APPLIER, engage="held", jaw="40 deg")
    session.step([1, 0])
    clips(session, 1.0, 500)
    session.step([0, 0])
    assert clips(session, 0.0, 3000) == 0
    session.step([1, 0])
    session.driver.set("gripper", [0.0])
    while np.degrees(session.outputs["jaw/servo_jp"][0]) > 15.0:
        session.step()
    assert clips(session, 0.0, 90) == 0
    assert clips(session, 0.0, 20) == 1


@pytest.mark.parametrize("instrument", ["400006", "palpation-probe"])
def test_other_instruments_have_no_clip(instrument):
    session = Session(instrument=instrument)
    assert "clip" not in {port.name for port in session.teleoperation.ports}
