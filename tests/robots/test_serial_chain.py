import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots import rotation
from robots.dvrk import psm
from robots.dvrk.instruments import instrument

CHAIN = psm.chain(instrument("palpation-probe"))

# Poses of the tip in the RCM frame, computed in double precision from the numbers of jhu-dvrk/sawIntuitiveResearchKit
# (share/kinematic/PSM.json, share/tool/LARGE_NEEDLE_DRIVER_400006.json) with 1.5708 taken as pi/2.
REFERENCE_POSES = [
    ([0, 0, 0, 0, 0, 0], [0.0, 0.0, 0.0065], [[0, 1, 0], [1, 0, 0], [0, 0, -1]]),
    (
        [0.3, -0.2, 0.15, 0.5, -0.4, 0.25],
        [0.042794255, 0.03141424, -0.132593198],
        [[0.261614256, 0.734433945, 0.626230598], [0.714829259, -0.583397599, 0.385572784], [0.648519168, 0.346776618, -0.677620001]],
    ),
    (
        [1.2, -0.7, 0.08, 2.5, 0.3, 0.9],
        [0.050228875, 0.048735989, -0.021254746],
        [[0.877391398, -0.328990764, 0.34921256], [-0.395001595, -0.908472569, 0.136569879], [0.272319803, -0.257764755, -0.927037894]],
    ),
    (
        [0.65, -0.35, 0.24, 4.0, -1.3, 1.3],
        [0.124860871, 0.072397047, -0.17521155],
        [[-0.672656663, 0.105696189, -0.732366936], [-0.494650277, 0.671866775, 0.551285896], [0.55032183, 0.733091639, -0.399653014]],
    ),
]

configurations = st.tuples(*(st.floats(joint.lower, joint.upper) for joint in CHAIN.joints)).map(np.array)


@pytest.mark.parametrize(("q", "position", "orientation"), REFERENCE_POSES)
def test_tip_stands_where_the_reference_says(q, position, orientation):
    tip = CHAIN.forward(np.array(q, float))
    assert np.allclose(tip[:3, 3], position, atol=1e-8)
    assert np.allclose(tip[:3, :3], orientation, atol=1e-8)


@given(configurations)
def test_forward_kinematics_is_the_product_of_the_links(q):
    product = np.eye(4)
    for joint, position in zip(CHAIN.joints, q, strict=True):
        product = product @ joint.transform(position)
    assert np.allclose(CHAIN.forward(q), product @ CHAIN.tip, atol=1e-14)


@given(configurations)
def test_jacobian_is_the_derivative_of_the_pose(q):
    step = 1e-6
    jacobian = CHAIN.jacobian(CHAIN.frames(q))
    for i, dq in enumerate(step * np.eye(len(q))):
        back, ahead = CHAIN.forward(q - dq), CHAIN.forward(q + dq)
        linear = (ahead[:3, 3] - back[:3, 3]) / (2 * step)
        turn = rotation.product(rotation.from_matrix(ahead), rotation.conjugate(rotation.from_matrix(back)))
        assert np.allclose(jacobian[:, i], [*linear, *(rotation.log(turn) / (2 * step))], atol=1e-8)
