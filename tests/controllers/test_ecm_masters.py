"""Two masters in the display's frame (x left, y up, z ahead), stepped by hand."""

import numpy as np
import pytest

from controllers.ecm_masters import EcmMasters, EcmMastersParams
from hub.testing import Driver, check_engine
from robots import rotation
from schemas.crtk import OperatingState
from schemas.errors import StateError
from schemas.ros import Joy

H = 2_000_000
LEFT, RIGHT = np.array([0.1, 0.0, 0.3]), np.array([-0.1, 0.0, 0.3])
X = np.array([1.0, 0.0, 0.0])
HOME = np.array([0.1, -0.1, 0.1, 0.0])


class Rig:
    def __init__(self, **params):
        self.participant = EcmMasters("camera", EcmMastersParams.model_validate(params))
        self.driver = Driver(self.participant, period_ns=H)
        self.values = self.driver.values
        self.values["measured_js"][:4] = HOME
        self.put(LEFT, RIGHT)

    outputs = property(lambda self: self.driver.outputs)

    def put(self, left, right):
        self.values["MTML/measured_cp"][:3], self.values["MTMR/measured_cp"][:3] = left, right
        return self

    def step(self, pressed=None, arm=None, silent=()):
        if pressed is not None:
            self.driver.send("buttons", Joy(buttons=[pressed]))
        if arm is not None:
            self.driver.send("operating_state", OperatingState(state=arm, is_homed=True))
        self.driver.stale(*(f"{master}/measured_cp" for master in silent))
        self.driver.step()
        return self

    @property
    def moved(self):
        """Joints from where they were when the pedal went down."""
        return self.outputs["ECM/servo_jp"][0].position - HOME

    def force(self, master):
        force = self.outputs[f"{master}/body/servo_cf"][0].wrench.force
        return np.array([force.x, force.y, force.z])


def test_the_first_step_moves_nothing_and_lets_the_masters_float():
    rig = Rig().step(1)
    assert np.abs(rig.moved).max() < 1e-12
    assert rig.outputs["following"].data
    assert np.abs(rig.force("MTML")).max() < 1e-12
    assert rig.outputs["MTMR/body/set_cf_orientation_absolute"][0].data
    assert rig.outputs["MTMR/lock_orientation"][0].w == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("turn", "joints"),
    [
        ([0.0, 0.2, 0.0], [-0.2, 0.0, 0.0, 0.0]),
        ([0.2, 0.0, 0.0], [0.0, 0.2, 0.0, 0.0]),
        ([0.0, 0.0, 0.2], [0.0, 0.0, 0.0, -0.2]),
    ],
)
def test_the_picture_is_turned_against_the_hands(turn, joints):
    rig, by = Rig().step(1), rotation.matrix(rotation.exp(np.array(turn)))
    rig.put(by @ LEFT, by @ RIGHT).step()
    assert np.allclose(rig.moved, joints, atol=1e-9)
    assert max(np.abs(rig.force(master)).max() for master in ("MTML", "MTMR")) < 1e-9


def test_pulling_brings_the_picture_nearer():
    rig = Rig(scale=0.5).step(1).put(LEFT - [0, 0, 0.04], RIGHT - [0, 0, 0.04]).step()
    assert np.allclose(rig.moved, [0.0, 0.0, 0.02, 0.0], atol=1e-12)


def test_hands_that_part_are_drawn_together_and_motion_is_rubbed():
    rig = Rig().step(1).put(LEFT + 0.01 * X, RIGHT - 0.01 * X)
    rig.values["MTMR/measured_cv"][:3] = [0.0, 0.1, 0.1]
    rig.step()
    assert np.allclose(rig.force("MTML"), [-1.5, 0.0, 0.0], atol=1e-9)
    assert np.allclose(rig.force("MTMR"), [1.5, -1.0, -4.0], atol=1e-9)


def test_it_follows_only_while_the_pedal_is_held_the_arm_is_ready_and_both_are_heard():
    rig = Rig().step()
    assert rig.outputs["ECM/servo_jp"] == ()
    rig.step(1).step(silent=["MTML"])
    assert rig.outputs["warning"][0].data == "ECM holds: MTML is silent"
    assert np.array_equal(rig.force("MTMR"), np.zeros(3))
    rig.step().step(arm="PAUSED")
    assert rig.outputs["warning"][0].data == "ECM holds: it is not ENABLED and homed"
    rig.step(arm="ENABLED").put(LEFT * 1.1, RIGHT * 1.1).step(0)
    assert (rig.outputs["ECM/servo_jp"], rig.outputs["warning"]) == ((), ())


def test_it_is_a_participant_whose_state_can_be_saved():
    poses = {
        "MTML/measured_cp": [*LEFT, 0, 0, 0, 1],
        "MTMR/measured_cp": [*RIGHT, 0, 0, 0, 1],
        "buttons": (Joy(buttons=[1]),),
    }
    check_engine(lambda: EcmMasters("camera", EcmMastersParams()), period_ns=H, inputs=poses)
    with pytest.raises(StateError, match="participant 'camera': a saved state of 1 bytes"):
        Rig().participant.restore(b"0")
