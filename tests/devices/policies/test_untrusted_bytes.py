"""Bytes of servers and child processes: whatever they are, they are a tree or a named error."""

import json
from contextlib import suppress
from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from devices.policies.array_messages import pack_groot, pack_openpi, unpack
from devices.policies.worker import read_frame, write_frame
from schemas.errors import MessageError

TREES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**31), 2**31)
    | st.text(max_size=8)
    | st.floats(allow_nan=False),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)
ARRAYS = st.sampled_from([np.uint8, np.float32, np.float64, np.int64]).flatmap(
    lambda dtype: arrays(dtype, array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=4))
)
PLACES = st.lists(st.tuples(st.integers(0, 400), st.integers(0, 255)), min_size=1, max_size=4)


def frame(tree):
    file = BytesIO()
    write_frame(file, tree)
    return file.getvalue()


@pytest.mark.parametrize("pack", [pack_openpi, pack_groot])
@given(tree=TREES, array=ARRAYS)
def test_a_message_comes_back(pack, tree, array):
    back = unpack(pack({"tree": tree, "array": array}))
    assert back["tree"] == tree
    assert (back["array"].dtype, back["array"].tobytes()) == (array.dtype, array.tobytes())


@given(tree=TREES, array=ARRAYS)
def test_a_frame_comes_back(tree, array):
    back = read_frame(BytesIO(frame({"tree": {"in": tree}, "array": array})))
    assert back["array"].tobytes() == array.tobytes()
    assert back["array"].shape == array.shape


@pytest.mark.parametrize("pack", [pack_openpi, pack_groot])
@given(array=ARRAYS, places=PLACES)
def test_a_changed_message_is_a_tree_or_an_error(pack, array, places):
    message = bytearray(pack({"actions": array, "n": 1}))
    for place, value in places:
        message[place % len(message)] = value
    with suppress(MessageError):
        unpack(bytes(message))


@given(st.binary(max_size=64))
def test_noise_is_a_tree_or_an_error(noise):
    with suppress(MessageError):
        unpack(noise)


@given(array=ARRAYS, places=PLACES)
def test_a_changed_frame_is_a_tree_or_an_error(array, places):
    message = bytearray(frame({"number": 1, "actions": array}))
    for place, value in places:
        message[place % len(message)] = value
    with suppress(EOFError, ValueError, KeyError, TypeError, OverflowError, RecursionError):
        read_frame(BytesIO(bytes(message)))


@pytest.mark.parametrize(
    "header",
    [
        b"[" * 100_000,
        json.dumps({"array": ["<f4", [2**40]]}).encode(),
        json.dumps({"array": ["<f4", [-1, -4]]}).encode(),
        json.dumps({"array": ["|O", [1]]}).encode(),
        json.dumps({"array": ["V8", [1]]}).encode(),
        json.dumps({"array": 7}).encode(),
        b"\xff\xff",
    ],
)
def test_a_header_that_lies_is_refused(header):
    with pytest.raises((ValueError, TypeError, RecursionError)):
        read_frame(BytesIO(len(header).to_bytes(4, "little") + header + bytes(64)))
