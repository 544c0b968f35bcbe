"""The directory of a session recorded by dvrk_data, the recorder of dVRK 2.4: index, videos and a ROS bag.

Read from jhu-dvrk/dvrk_data 1.0.0 (src/record/ui.cpp, dvrk_data/extract.py).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

from pydantic_core import from_json

from schemas.errors import RecordingError

__all__ = ["BAG", "INDEX", "INDEX_TYPE", "session_bag"]

INDEX = "index.json"
INDEX_TYPE = "dvrk_data:index@1.0.0"
BAG = "rosbag"
"""Name of the ROS bag, as the recorder gives it."""
_LARGEST = 2**20
"""Largest index that is read, bytes."""


def session_bag(path: Path) -> Path:
    """Return the ROS bag of a session's directory; any other path as it is.

    Raises RecordingError for an index of another version, or without a bag inside the directory.
    """
    file = path / INDEX
    if not file.is_file():
        return path
    try:
        content: Any = from_json(file.read_bytes()) if file.stat().st_size <= _LARGEST else None
    except (OSError, ValueError) as error:
        raise RecordingError(f"cannot read '{file}': {error}") from error
    index = cast("dict[str, Any]", content) if isinstance(content, dict) else {}
    if index.get("type") != INDEX_TYPE:
        stated = str(index.get("type"))[:80]
        raise RecordingError(f"'{file}' is of type '{stated}'; '{INDEX_TYPE}' is read")
    bag = index.get("rosbags")
    if not isinstance(bag, str) or Path(bag).name != bag or not (path / bag).exists():
        raise RecordingError(f"'{file}' names no ROS bag beside it: 'rosbags' is {str(bag)[:80]!r}")
    return path / bag
