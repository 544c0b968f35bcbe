from math import degrees, radians

import numpy as np
import pytest

from controllers.teleoperation.jaw import JawGhost
from robots.dvrk.instruments import instrument
from tests.controllers.teleoperation.rig import Session

JAW = instrument("LARGE_NEEDLE_DRIVER_400006").jaw
H = 1e-3


def ghost(angle):
    made = JawGhost(JAW)
    made.stand_at(radians(angle))
    return made


def angles(made, gripper, count):
    found = []
    for _ in range(count):
        made.follow(gripper, H)
        found.append(degrees(made.angle))
    return np.array(found)


def share(angle):
    """Of the gripper that leads the jaw to `angle` (deg)."""
    return (radians(angle) - JAW.lower) / (JAW.upper - JAW.lower)


def test_it_goes_slowly_until_it_has_caught_up_and_quickly_from_then_on():
    made = ghost(10.0)
    slow = angles(made, share(30.0), 600)
    assert np.diff(slow)[:480] == pytest.approx(36.0 * H)
    assert slow[-1] == pytest.approx(30.0)
    assert angles(made, share(10.0), 10) == pytest.approx(30.0 - 0.72 * np.arange(1, 11))
    made.release()
    assert angles(made, share(50.0), 10) == pytest.approx(22.8 + 0.036 * np.arange(1, 11))


def test_it_never_leaves_the_range_of_the_jaw():
    made = ghost(-500.0)
    assert made.angle == JAW.lower
    assert np.radians(angles(made, 0.0, 100)).min() == JAW.lower
    assert np.radians(angles(made, 7.0, 10_000)).max() == pytest.approx(JAW.upper)


def test_the_button_closes_while_it_is_pressed_and_says_nothing_before():
    made = ghost(20.0)
    made.press(pressed=False)  # with every event of another button
    assert angles(made, -1.0, 50) == pytest.approx(20.0)
    made.press(pressed=True)
    assert angles(made, -1.0, 3000)[-1] == pytest.approx(degrees(JAW.lower))
    made.press(pressed=False)
    assert angles(made, -1.0, 3000)[-1] == pytest.approx(45.0)


def test_the_jaw_starts_where_it_is_measured_and_holds_while_the_arm_holds():
    session = Session(instrument="400006", jaw="10 deg")
    assert session.outputs["jaw/servo_jp"] == pytest.approx([radians(10.0)])
    session.values["jaw/measured_js"][0] = radians(25.0)
    session.step([0, 1], stale=True, count=20)
    assert session.outputs["jaw/servo_jp"] == pytest.approx([radians(25.0)])
    session.step(count=100)
    assert session.outputs["jaw/servo_jp"] == pytest.approx([radians(25.0 - 3.6)])
    session.step([1, 1], count=100)
    assert session.outputs["jaw/servo_jp"] == pytest.approx([radians(25.0 - 3.6)])


def test_a_gripper_that_is_connected_leads_instead_of_the_button():
    session = Session(instrument="400006", jaw="10 deg")
    session.values["gripper"][0] = share(20.0)
    session.step([0, 1], count=2000)
    assert session.outputs["jaw/servo_jp"] == pytest.approx([radians(20.0)])


def test_what_rolls_a_needle_stays_and_what_has_no_jaw_has_no_port():
    session = Session(instrument="ROLLING_NEEDLE_DRIVER")
    session.values["jaw/measured_js"][:2] = 0.1, 0.7
    session.step([0, 1], count=50)
    assert session.outputs["jaw/servo_jp"][1] == 0.7
    for name in ("palpation-probe", "MUSHA_HAND"):
        assert not [
            port.name for port in Session(instrument=name).teleoperation.ports if port.name.startswith("jaw")
        ]
