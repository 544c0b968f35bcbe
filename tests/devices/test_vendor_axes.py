import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.vendor_axes import quaternion, vector
from robots import rotation

angles = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)


def test_ahead_left_and_up():
    assert vector(0, 0, -1) == (1, 0, 0)
    assert vector(-1, 0, 0) == (0, 1, 0)
    assert vector(0, 1, 0) == (0, 0, 1)


@given(angles, angles)
def test_a_rotation_turns_the_same_vector_the_same_way(turn, point):
    vendor = rotation.exp(turn)
    turned = vector(*rotation.matrix(vendor) @ point)
    assert np.allclose(rotation.matrix(np.array(quaternion(*vendor))) @ vector(*point), turned, atol=1e-12)


def test_single_precision_is_normalised():
    x, y, z, w = quaternion(0.5000001, -0.5, 0.4999999, 0.5000002)
    assert abs(x * x + y * y + z * z + w * w - 1.0) < 1e-15


@pytest.mark.parametrize(
    "nothing", [(0, 0, 0, 0), (float("nan"), 0, 0, 1), (float("inf"), 0, 0, 0), (3, 0, 0, 0)]
)
def test_what_is_no_rotation(nothing):
    with pytest.raises(ValueError, match="no unit quaternion"):
        quaternion(*nothing)
