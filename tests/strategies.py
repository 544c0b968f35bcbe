"""Hypothesis strategies for messages and ports, shared by the tests."""

from __future__ import annotations

import math
from typing import Any, get_args, get_origin

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from schemas.codec import message_types
from schemas.message import Message, msg_text
from schemas.ports import Port
from schemas.ros import Time
from schemas.visualization import DurationMessage

finite = st.floats(allow_nan=False, allow_infinity=False)
texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=12)
names = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,8}", fullmatch=True)

_SCALARS: dict[str, st.SearchStrategy[Any]] = {
    "float64": finite,
    "float32": st.floats(width=32, allow_nan=False, allow_infinity=False),
    "bool": st.booleans(),
    "byte": st.integers(0, 2**7 - 1),
    "string": texts,
    "string[]": st.lists(texts, max_size=4),
    **{f"uint{bits}": st.integers(0, 2**bits - 1) for bits in (8, 16, 32, 64)},
    **{f"int{bits}": st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
}


def vectors(size: int | st.SearchStrategy[int], dtype: Any = np.float64) -> st.SearchStrategy[NDArray[Any]]:
    """Finite one-dimensional arrays."""
    elements = {"allow_nan": False, "allow_infinity": False} if np.dtype(dtype).kind == "f" else {}
    return arrays.arrays(dtype, size, elements=arrays.from_dtype(np.dtype(dtype), **elements))


def messages(model: type[Message]) -> st.SearchStrategy[Message]:
    """Valid messages of a type, drawn field by field from its .msg text."""
    if issubclass(model, Time | DurationMessage):
        return st.builds(model.from_ns, st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1))
    rows = (line.split() for line in msg_text(model).splitlines())
    return st.builds(model, **{name: _field(model, ros_type, name) for ros_type, name in rows})


def _field(model: type[Message], ros_type: str, name: str) -> st.SearchStrategy[Any]:
    if ros_type == "float64" and any(
        getattr(mark, "ge", None) == 0.0 for mark in model.model_fields[name].metadata
    ):
        return finite.map(abs)
    if ros_type in _SCALARS:
        return _SCALARS[ros_type]
    annotation = model.model_fields[name].annotation
    if isinstance(annotation, type) and issubclass(annotation, Message):
        return messages(annotation)
    if get_origin(annotation) is list:
        return st.lists(messages(get_args(annotation)[0]), max_size=2)
    element, _, length = ros_type.rstrip("]").partition("[")
    return vectors(int(length) if length else st.integers(0, 5), element)


MODELS = [model for _, model in sorted(message_types().items())]
"""All types of messages. A test of each of them draws one message of a type after the other."""
of_each_type = settings(
    max_examples=settings().max_examples // 4,
    suppress_health_check=[*settings().suppress_health_check, HealthCheck.data_too_large],
)
"""Number of examples of such a test: each is large, as it has a message of every type."""

_unit_quaternions = (
    vectors(4)
    .map(lambda q: q / max(math.hypot(*q), 1.0))
    .filter(lambda q: math.hypot(*q) > 0.1)
    .map(lambda q: q / math.hypot(*q))
)
_poses = st.tuples(vectors(3), _unit_quaternions).map(np.concatenate)


frames = st.sampled_from(["", "world", "PSM1/base"])


@st.composite
def ports(draw: st.DrawFn) -> Port:
    """Signal ports whose values are vectors."""
    kind = draw(
        st.sampled_from(
            ["Float64", "Float64MultiArray", "PoseStamped", "TwistStamped", "WrenchStamped", "JointState"]
        )
    )
    given: dict[str, Any] = {"name": "arm/port", "causality": "output"}
    if kind.startswith("Float64"):
        size = draw(st.integers(1, 5)) if kind.endswith("Array") else 1
        return Port(**given, type=f"std_msgs/msg/{kind}", size=size)
    if kind == "JointState":
        joints = draw(st.lists(names, min_size=1, max_size=4, unique=True))
        fields = draw(st.lists(st.sampled_from(["position", "velocity", "effort"]), min_size=1, unique=True))
        return Port(
            **given,
            type="sensor_msgs/msg/JointState",
            names=tuple(joints),
            fields=tuple(fields),
            frame=draw(frames),
        )
    return Port(**given, type=f"geometry_msgs/msg/{kind}", frame=draw(frames))


def values(port: Port, size: int) -> st.SearchStrategy[NDArray[np.float64]]:
    """Valid values of a port whose vectors have `size` elements."""
    return _poses if port.type.endswith("PoseStamped") else vectors(size)
