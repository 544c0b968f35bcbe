"""A mirror between a real arm that a test moves and the motion controller of a simulated one, whose robot is
where it is told to be.
"""

import numpy as np
import pytest

from controllers.mirror import Mirror, MirrorParams
from hub.testing import Driver, check_engine
from schemas.crtk import OperatingState
from schemas.errors import StateError
from tests.controllers.motion.rig import Rig

ARMS = {"PSM1": {"instrument": "400006"}}
H = 1_000_000
SAMPLE_MS = 10
"""The dVRK publishes at 100 Hz."""
SWING = np.array([0.3, 0.2, 0.03, 0.5, 0.2, -0.2])
CENTRE = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])
OMEGA = 2.0 * np.pi * 0.5


def real_arm(seconds):
    """Positions and velocities of an arm that swings at 0.5 Hz."""
    return np.concatenate(
        [CENTRE + SWING * np.sin(OMEGA * seconds), SWING * OMEGA * np.cos(OMEGA * seconds), np.zeros(6)]
    )


class Pair:
    def __init__(self):
        self.mirror, self.motion = (
            Mirror("mirror", MirrorParams.model_validate({"arms": ARMS})),
            Rig(publish_period="1 ms"),
        )
        self.driver, self.said = Driver(self.mirror, period_ns=H), []

    outputs = property(lambda self: self.driver.outputs)

    def step(self, t_ms, silent=False):
        if not silent and t_ms % SAMPLE_MS == 0:
            self.driver.set("real/PSM1/measured_js", real_arm(t_ms * 1e-3))
        self.driver.stale(*(["real/PSM1/measured_js"] if silent else []))
        self.driver.set("PSM1/measured_js", self.motion.outputs["PSM1/measured_js"])
        self.driver.step()
        self.said += [message.data for message in self.outputs["PSM1/warning"]]
        orders = {
            port.removeprefix("PSM1/").replace("/", "__"): self.outputs[port]
            for port in ("PSM1/servo_jp", "PSM1/hold")
            if self.outputs[port]
        }
        self.motion.step(**orders)
        assert not self.motion.said("error")
        return self.motion.setpoint


def test_the_simulated_arm_follows_and_the_lag_is_that_of_one_sample_and_its_line():
    pair = Pair()
    for t_ms in range(2500):
        pair.step(t_ms)
    now, then = real_arm(2.5)[:6], real_arm(2.5 - 2e-3 * SAMPLE_MS)[:6]
    assert (np.abs(pair.motion.setpoint - now) <= 1.2 * np.abs(then - now)).all()
    (lag,), (distance,) = pair.outputs["PSM1/lag"], pair.outputs["PSM1/distance"]
    assert 0.5e-3 * SAMPLE_MS < lag.data < 1.6e-3 * SAMPLE_MS
    assert 0.0 < distance.data < 0.004


def test_an_arm_that_does_not_follow_has_neither_lag_nor_distance():
    pair = Pair()
    pair.step(0, silent=True)
    assert (pair.outputs["PSM1/lag"], pair.outputs["PSM1/distance"]) == ((), ())
    pair.driver.set("real/PSM1/measured_js", [*CENTRE, *np.zeros(12)])  # follows, but stands
    pair.step(1)
    assert pair.outputs["PSM1/lag"] == ()
    assert len(pair.outputs["PSM1/distance"]) == 1


def test_a_silent_arm_holds_and_follows_again():
    pair = Pair()
    for t_ms in range(400):
        pair.step(t_ms)
    pair.step(400, silent=True)
    assert pair.said == ["PSM1 holds: its real arm has been silent for more than 100 ms"]
    for t_ms in range(401, 900):
        held = pair.step(t_ms, silent=True)
    assert np.array_equal(held, pair.step(900, silent=True))
    for t_ms in range(901, 2000):
        pair.step(t_ms)
    assert np.abs(pair.motion.setpoint - real_arm(2.0)[:6]).max() < 0.05
    assert len(pair.said) == 1


def test_an_arm_that_is_not_ready_is_told_nothing():
    pair = Pair()
    pair.driver.send("PSM1/operating_state", OperatingState(state="DISABLED"))
    pair.step(0)
    assert pair.outputs["PSM1/servo_jp"] == ()
    pair.driver.send("PSM1/operating_state", OperatingState(state="ENABLED", is_homed=True))
    pair.step(1)
    assert len(pair.outputs["PSM1/servo_jp"]) == 1


def test_positions_beyond_the_simulated_ranges_are_cut_there():
    pair = Pair()
    pair.driver.set("real/PSM1/measured_js", [9.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0, *np.zeros(11)])
    (command,) = pair.driver.step()["PSM1/servo_jp"]
    assert command.position[0] == pytest.approx(np.radians(91.0), rel=0.2)
    assert command.velocity[0] == 0.0


def test_it_is_a_participant_whose_state_can_be_saved():
    check_engine(lambda: Mirror("mirror", MirrorParams.model_validate({"arms": ARMS})), period_ns=H)
    with pytest.raises(StateError, match="participant 'mirror': a saved state of 1 bytes"):
        Pair().mirror.restore(b"0")
