"""The text of a control message, with limits checked before the JSON is parsed.

A parser of JSON and the models behind the parser take time and memory by the content of a message: sixteen
nested messages held a hub for two minutes.
"""

from __future__ import annotations

import re

from schemas.codec import decode
from schemas.errors import MessageError
from schemas.ros import StringMessage

__all__ = ["MOST_BYTES", "control_text"]

MOST_BYTES = 2**18
"""The largest value set by hand has some thousand numbers."""

_MOST_NESTED = 16
"""A pose with covariance, as JSON within a request, has 6."""

_STRINGS = re.compile(r'"(?:[^"\\]|\\.)*"?', re.DOTALL)
_NO_BRACKETS = re.compile(r"[^\[\]{}]+")


def control_text(payload: bytes) -> str:
    """Return the JSON in a `std_msgs/String`; raises MessageError if too long or too deeply nested."""
    if len(payload) > MOST_BYTES:
        raise MessageError(f"{len(payload)} bytes, a control message has at most {MOST_BYTES}")
    text = decode(StringMessage, payload).data
    depth = 0
    for bracket in _NO_BRACKETS.sub("", _STRINGS.sub("", text)):
        depth += 1 if bracket in "[{" else -1
        if depth > _MOST_NESTED:
            raise MessageError(f"its JSON is nested more than {_MOST_NESTED} deep")
    return text
