"""Meshes of programs: the triangles of a binary STL file."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schemas.errors import MessageError
from schemas.vectors import Vector

__all__ = ["stl_triangles"]

_TITLE = 80
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("attribute", "<u2")])
"""StereoLithography Interface Specification, 3D Systems, 1988: a title of 80 bytes, the number of triangles,
and each of them.
"""


def stl_triangles(data: NDArray[np.uint8]) -> Vector:
    """Return the corners of all triangles, three after the other, shape (3 f, 3), m, from a file's bytes.

    Raises MessageError if it is no binary STL.
    """
    content = data.tobytes()
    count = int.from_bytes(content[_TITLE : _TITLE + 4], "little")
    body = content[_TITLE + 4 :]
    if not count or len(body) != count * _TRIANGLE.itemsize:
        raise MessageError(
            f"mesh_file of {len(content)} bytes is no binary STL: {count} triangles need"
            f" {_TITLE + 4 + count * _TRIANGLE.itemsize} bytes, and there must be one"
        )
    corners = np.frombuffer(body, _TRIANGLE)["corners"].astype(np.float64).reshape(-1, 3)
    if not np.isfinite(corners).all():
        raise MessageError("mesh_file has a corner that is not finite")
    return corners
