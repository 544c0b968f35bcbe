import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.participant import VectorSample
from schemas.codec import encode
from schemas.errors import MessageError
from schemas.ports import Port
from schemas.ros import PoseStamped
from schemas.vectors import VectorCodec

POSE = VectorCodec(Port(name="pose", causality="output", type=PoseStamped.ros_type, frame="base"))
coordinates = st.tuples(*[st.floats(-1e3, 1e3)] * 3)


@given(coordinates, st.integers(0, 2**31 * 10**9 - 1))
def test_numbers_are_encoded_as_the_message_that_they_make(position, time_ns):
    sample = VectorSample(POSE, np.array([*position, 0.0, 0.0, 0.0, 1.0]), time_ns)
    message = sample.message
    assert isinstance(message, PoseStamped)
    assert (sample.port, message.header.stamp.ns, message.header.frame_id) == ("pose", time_ns, "base")
    assert sample.encode() == encode(message)
    assert sample.message is message


@pytest.mark.parametrize("value", [np.full(7, np.nan), np.zeros(6)])
def test_numbers_that_are_no_value_of_the_port_are_refused(value):
    with pytest.raises(MessageError, match="pose"):
        VectorSample(POSE, value, 0)
