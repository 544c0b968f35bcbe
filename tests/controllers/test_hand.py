"""A hand on a master, by itself."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from controllers.hand import Hand, HandParams
from hub.participant import Setup
from hub.testing import Driver, check_engine
from robots import rotation
from schemas.ros import BoolMessage, Joy

MASTER = np.array([0.1, -0.2, 0.4, *rotation.exp(np.array([0.3, 0.2, -0.1]))])
DEVICE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
LEFT = np.array([0.04, 0.0, 0.0])
PATH = [{"at": "0 s"}, {"at": "1 s", "position": [0.04, 0.0, 0.0], "gripper": 0.2}, {"at": "2 s"}]


def hand(*, device=False, **params):
    inputs = {"master": MASTER, **({"pose": DEVICE} if device else {})}
    return Driver(Hand("hand", HandParams.model_validate(params)), inputs=inputs)


def test_conforms():
    check_engine(lambda: Hand("hand", HandParams.model_validate({"path": PATH})))


def test_follows_its_path_from_where_the_gripper_is_and_again():
    driver = hand(path=PATH)
    driver.step(1000)
    np.testing.assert_allclose(driver.outputs["MTMR/hand_cp"][:3], MASTER[:3] + LEFT, atol=1e-5)
    assert driver.outputs["MTMR/hand_grip"][0] == 1.0
    assert driver.outputs["MTMR/gripper/servo_jp"][0] == pytest.approx(0.2, abs=0.01)
    driver.step(2000)
    np.testing.assert_allclose(driver.outputs["MTMR/hand_cp"][:3], MASTER[:3] + LEFT, atol=1e-4)


def test_follows_a_device_as_seen_in_the_viewer():
    driver = hand(device=True, scale=0.5)
    driver.step(200)
    turn = rotation.exp(np.array([0.0, 0.0, 0.4]))  # about up on the desk
    driver.set("pose", [0.02, 0.0, 0.0, *turn])  # away
    driver.step()
    pose = driver.outputs["MTMR/hand_cp"]
    np.testing.assert_allclose(pose[:3], MASTER[:3] + np.array([0.0, 0.0, 0.01]), atol=1e-12)
    expected = rotation.product(rotation.exp(np.array([0.0, 0.4, 0.0])), MASTER[3:])
    np.testing.assert_allclose(pose[3:], expected, atol=1e-12)


def test_lets_go_when_its_device_is_silent_and_says_so():
    driver = hand(device=True)
    driver.step(200)
    driver.stale("pose")
    driver.step(200)
    assert driver.outputs["MTMR/hand_grip"][0] == 0.0
    assert "MTMR hangs" in driver.sent["warning"][0].data


def test_a_button_frees_the_hand():
    driver = hand(device=True)
    driver.step(200)
    driver.send("buttons", Joy(buttons=np.array([1], np.int32)))
    driver.step(200)
    assert driver.outputs["MTMR/hand_grip"][0] == 0.0
    driver.send("buttons", Joy(buttons=np.array([0, 1], np.int32)))
    driver.step(300)
    assert driver.outputs["MTMR/hand_grip"][0] == 1.0
    assert driver.outputs["MTMR/gripper/servo_jp"][0] == 0.0


def test_squeezes_until_the_instrument_follows():
    one = Hand("hand", HandParams.model_validate({"path": PATH}))
    driver = Driver(one, inputs={"master": MASTER})
    one.configure(Setup(1_000_000, Path.cwd(), {}, frozenset({"master", "following"})))
    openings = []
    for _ in range(1000):
        driver.step()
        openings.append(float(driver.outputs["MTMR/gripper/servo_jp"][0]))
    assert driver.outputs["MTMR/hand_grip"][0] == 0.0
    assert np.ptp(openings) > np.radians(40.0)
    driver.send("following", BoolMessage(data=True))
    driver.step(200)
    assert driver.outputs["MTMR/hand_grip"][0] == 1.0


def test_a_path_goes_forward_in_time():
    with pytest.raises(ValidationError, match="must rise"):
        HandParams.model_validate({"path": [{"at": "1 s"}, {"at": "1 s"}]})
