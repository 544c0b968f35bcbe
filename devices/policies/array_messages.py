"""Messages of policy servers: msgpack with arrays of numbers, in the forms of openpi and of GR00T. No pickle.

openpi    {b"__ndarray__": True, b"data": bytes, b"dtype": text, b"shape": numbers}
          (Physical-Intelligence/openpi, packages/openpi-client, 0.1.2)
GR00T     {"__ndarray_class__": True, "as_npy": bytes of numpy.save}
          (NVIDIA/Isaac-GR00T, gr00t/policy/server_client.py, N1.7)
"""

from __future__ import annotations

from io import BytesIO
from math import prod
from tokenize import TokenError
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from schemas.errors import MessageError, MissingExtraError

__all__ = ["MOST_BYTES", "check_package", "pack_groot", "pack_openpi", "unpack"]

MOST_BYTES = 64 * 2**20
"""Largest message of a server."""
_KINDS = "biuf"
_HEADERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


def check_package(backend: str, *packages: str) -> None:
    """Raise MissingExtraError if a package of the extra `policy` is missing."""
    from importlib.util import find_spec

    for package in packages:
        if find_spec(package) is None:
            raise MissingExtraError(f"policy '{backend}'", "policy", package)


def pack_openpi(tree: Any) -> bytes:
    """Return a message in openpi's form."""
    import msgpack

    return msgpack.packb(tree, default=_openpi_array)


def pack_groot(tree: Any) -> bytes:
    """Return a message in GR00T's form."""
    import msgpack

    return msgpack.packb(tree, default=_groot_array)


def unpack(message: bytes) -> Any:
    """Return the tree of a message in either form.

    Raises MessageError for bytes that are no message, and for arrays of anything but numbers.
    """
    import msgpack

    try:
        return msgpack.unpackb(message, object_hook=_array_or_tree)
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
        # the exceptions of msgpack are ValueErrors
        raise MessageError(f"no valid message: {type(error).__name__}: {error}") from error


def _openpi_array(value: object) -> Any:
    array = _numbers(value)
    return {
        b"__ndarray__": True,
        b"data": array.tobytes(),
        b"dtype": array.dtype.str,
        b"shape": array.shape,
    }


def _groot_array(value: object) -> Any:
    file = BytesIO()
    np.save(file, _numbers(value), allow_pickle=False)
    return {"__ndarray_class__": True, "as_npy": file.getvalue()}


def _numbers(value: object) -> NDArray[Any]:
    array: NDArray[Any] = np.asarray(value)
    if array.dtype.kind not in _KINDS:
        raise MessageError(f"a {type(value).__name__} cannot be sent to a policy, only numbers and texts")
    return array


def _array_or_tree(tree: dict[Any, Any]) -> Any:
    if b"__ndarray__" in tree:
        return _array(tree[b"data"], np.dtype(tree[b"dtype"]), tree[b"shape"])
    if b"__npgeneric__" in tree:
        return tree[b"data"]
    if "__ndarray_class__" in tree:
        return _saved_array(tree["as_npy"])
    return tree


def _array(data: bytes, dtype: np.dtype[Any], shape: Any) -> NDArray[Any]:
    if dtype.kind not in _KINDS:
        raise ValueError(f"an array of {dtype}, only numbers are allowed")
    counts = tuple(int(count) for count in cast("list[Any]", shape))
    if min(counts, default=1) < 0 or prod(counts) * dtype.itemsize != len(data):
        raise ValueError(f"an array of shape {counts} and {dtype} with {len(data)} bytes")
    return np.frombuffer(data, dtype).reshape(counts)


def _saved_array(data: bytes) -> NDArray[Any]:
    """Return the array of a .npy file, sizes checked before anything is allocated."""
    file = BytesIO(data)
    read_header = _HEADERS[np.lib.format.read_magic(file)]
    try:
        shape, is_fortran, dtype = read_header(file)
    except (SyntaxError, TokenError) as error:  # the header is a dictionary in Python's notation
        raise ValueError(f"no header of a .npy file: {error}") from error
    array = _array(data[file.tell() :], dtype, shape[::-1] if is_fortran else shape)
    return array.T if is_fortran else array
