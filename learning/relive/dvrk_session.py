"""Joint set-points of a session recorded by dvrk_data, or of any ROS bag of a dVRK."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hub.recording.dvrk_session import INDEX
from hub.recording.ros_bag_reader import RosBag
from learning.relive.arms import PlacedArm, Way
from schemas.errors import RecordingError
from schemas.ros import JointState
from schemas.vectors import Vector

__all__ = ["is_dvrk_session", "session_ways"]

_JOINTS, _JAW = "setpoint_js", "jaw/setpoint_js"


def is_dvrk_session(path: Path) -> bool:
    """Return whether `path` is a session's directory or a rosbag2 directory."""
    return any((path / name).is_file() for name in (INDEX, "metadata.yaml"))


@dataclass(frozen=True)
class _Positions:
    """Positions of a topic, with their times."""

    times_ns: NDArray[np.int64]
    """Shape (n,)."""
    values: Vector
    """Shape (n, joints), rad or m."""

    def at(self, times_ns: NDArray[np.int64]) -> Vector:
        """Return the newest positions at each time, the first positions before."""
        return self.values[np.maximum(np.searchsorted(self.times_ns, times_ns, side="right") - 1, 0)]


def session_ways(path: Path, placed: Mapping[str, PlacedArm]) -> tuple[float, dict[str, Way]]:
    """Return the frames of a second and the way of each arm whose set-points are in the session.

    Raises RecordingError if none are, or if they are no set-points of that arm.
    """
    with RosBag(path) as bag:
        joints = {arm: _positions(bag, f"/{arm}/{_JOINTS}") for arm in placed}
        jaws = {arm: _positions(bag, f"/{arm}/{_JAW}") for arm in placed}
    present = {arm: one for arm, one in joints.items() if one is not None and len(one.times_ns) > 1}
    if not present:
        topics = ", ".join(f"/{arm}/{_JOINTS}" for arm in placed)
        raise RecordingError(f"'{path}' has none of {topics}: nothing leads an arm of the scenario")
    ways: dict[str, Way] = {}
    times_ns = next(iter(present.values())).times_ns
    for arm, one in present.items():
        expected = len(placed[arm].mounted.chain.joints)
        if one.values.shape[1] != expected:
            raise RecordingError(
                f"'{path}': /{arm}/{_JOINTS} has {one.values.shape[1]} joints, the arm has {expected}"
            )
        jaw = jaws[arm]
        opening = np.zeros(len(times_ns)) if jaw is None else jaw.at(times_ns)[:, 0]
        ways[arm] = Way(one.at(times_ns), opening, np.ones(len(times_ns)), "")
    return 1e9 / float(np.median(np.diff(times_ns))), ways


def _positions(bag: RosBag, topic: str) -> _Positions | None:
    """Return the positions of a topic with joints; None if it is missing."""
    if topic not in bag.topics or bag.topics[topic].type != JointState.ros_type:
        return None
    times_ns: list[int] = []
    values: list[Vector] = []
    for _, time_ns, message in bag.messages([topic], bag.start_ns):
        position: Any = getattr(message, "position", None)
        value = np.asarray([] if position is None else position, np.float64)
        if not value.size or not np.isfinite(value).all() or (values and value.shape != values[0].shape):
            raise RecordingError(f"'{bag.path}': topic '{topic}' at {time_ns} ns: no joint positions")
        times_ns.append(time_ns)
        values.append(value)
    return _Positions(np.array(times_ns, np.int64), np.array(values)) if values else None
