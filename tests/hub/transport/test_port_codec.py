"""The codec of an output encodes a message once, whoever sends or records it."""

import numpy as np

from hub.transport.port_codec import PortCodec
from schemas.codec import encode
from schemas.ports import Port
from schemas.ros import CompressedImage


def picture(value: int) -> CompressedImage:
    return CompressedImage(format="png", data=np.full(1000, value, np.uint8))


def test_the_newest_message_is_encoded_once():
    codec = PortCodec(Port(name="left", causality="output", type=CompressedImage.ros_type))
    first, second = picture(1), picture(2)
    payload = codec.encode(first, 0)
    assert codec.pack(first) is payload
    assert payload == encode(first)
    assert codec.encode(second, 0) == encode(second)
    assert codec.encode(first, 0) == payload
