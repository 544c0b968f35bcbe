"""Masters: inverse kinematics, and bodies with the identified dynamics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.dvrk import arm_bodies, identified_mtm, mtm
from robots.dvrk.dynamics import Dynamics
from robots.dvrk.inverse import inverse
from robots.dvrk.linkage import MTM
from schemas.errors import MotionError

SIDES = st.sampled_from(["MTML", "MTMR"])


def within(chain, shares):
    return chain.lower + np.array(shares) * (chain.upper - chain.lower)


@given(SIDES, st.lists(st.floats(0.05, 0.95), min_size=7, max_size=7))
def test_inverse_gives_the_pose_again(side, shares):
    chain = mtm.chain(side)
    q = within(chain, shares)
    found = inverse(chain, chain.forward(q), q)
    np.testing.assert_allclose(chain.forward(found), chain.forward(q), atol=1e-12)
    np.testing.assert_array_less(chain.lower - 1e-9, found)
    np.testing.assert_array_less(found, chain.upper + 1e-9)


def test_inverse_of_several_poses():
    chain = mtm.chain("MTMR")
    q = np.array([within(chain, [share] * 7) for share in (0.4, 0.5)])
    found = inverse(chain, chain.forward(q), q)
    np.testing.assert_allclose(chain.forward(found), chain.forward(q), atol=1e-12)


def test_the_platform_takes_over_from_a_turned_wrist():
    chain = mtm.chain("MTML")
    q = np.array([0.0, 0.2, 0.1, -0.5, 0.3, 0.5, 0.0])
    found = q
    for _ in range(20):
        found = inverse(chain, chain.forward(q), found)
    assert abs(found[5]) < 0.05


def test_a_gripper_out_of_reach_is_refused():
    chain = mtm.chain("MTML")
    pose = chain.forward(np.zeros(7))
    pose[:3, 3] *= 2.0
    with pytest.raises(MotionError, match=r"0\.7.* m from the shoulder, allowed are"):
        inverse(chain, pose, np.zeros(7))


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_bodies_have_the_identified_dynamics(share):
    chain = mtm.chain("MTML")
    q = within(chain, [share] * 7)
    found = Dynamics(chain, MTM, arm_bodies.mtm(), np.zeros(7))
    # handles of 4 g are part of the bodies alone
    np.testing.assert_allclose(found.gravity(q), identified_mtm.gravity(q), atol=0.025)
    error = found.inertia_matrix(q) - identified_mtm.inertia_matrix(q)
    assert np.abs(error).max() < 0.012
    assert np.abs(error[3:, 3:]).max() < 6e-4


def test_every_body_is_possible():
    for name, body in arm_bodies.mtm().items():
        assert np.linalg.eigvalsh(body.pseudo_inertia).min() > 0.0, name
