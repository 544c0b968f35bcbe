"""Metrics of real arms, from ROS bags."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hub.recording.ros_bag_reader import RosBag
from robots import rotation
from robots.dvrk.mounted.mounted_psm import MountedPsm
from schemas.errors import RecordingError
from schemas.magnitudes import MAGNITUDES
from schemas.ros import JointState, PoseStamped
from schemas.vectors import Vector
from tasks.params import TaskParams
from tasks.practice import PracticeTask
from tasks.recorded.streams import Scored, Stream, score

__all__ = ["score_ros_bag"]

_PERIOD_NS = 10_000_000
_INSTRUMENT = "LARGE_NEEDLE_DRIVER_400006"
"""Instrument assumed for the tip of an arm with recorded joints only."""
_LEAST_NORM, _GREATEST_NORM = 0.9, 1.1
"""Norms of a rounded or badly normalised but usable quaternion."""
_CHAIN = MountedPsm(instrument=_INSTRUMENT).chain
_SOURCES = ("local/measured_cp", "measured_cp", "measured_js")
"""Topics of an arm with the tip's pose, the best first: independent of the endoscope's motion."""
_TOPIC = re.compile(r"(?:.*/)?(PSM[123])/(" + "|".join(_SOURCES) + ")")


def score_ros_bag(path: Path, rules: Sequence[str]) -> Scored:
    """Return the metrics of the arms in a ROS bag; metrics of objects or a scene are missing.

    Raises RecordingError for an unreadable bag or a bag without a topic of an arm, ScenarioError for unknown
    rules.
    """
    with RosBag(path) as bag:
        topics = _arm_topics(bag)
        if not topics:
            raise RecordingError(
                f"'{path}' cannot be scored: it has no topic such as /PSM1/measured_cp or /PSM1/measured_js;"
                " record one of them: ros2 bag record /PSM1/measured_cp /PSM2/measured_cp"
            )
        params = {"arms": {arm: {"instrument": _INSTRUMENT} for arm in sorted(topics)}, "rules": list(rules)}
        task = PracticeTask("practice", TaskParams.model_validate(params))
        streams = {f"{arm}/measured_cp": _tips(bag, topic) for arm, topic in topics.items()}
    return score(task, streams, _PERIOD_NS)


def _arm_topics(bag: RosBag) -> dict[str, str]:
    """Return the best topic about each arm's tip."""
    found: dict[str, tuple[int, str]] = {}
    for topic, about in bag.topics.items():
        match = _TOPIC.fullmatch(topic)
        types = (PoseStamped.ros_type, JointState.ros_type)
        if match is None or not about.messages or about.type not in types:
            continue
        rank = _SOURCES.index(match[2])
        if match[1] not in found or rank < found[match[1]][0]:
            found[match[1]] = rank, topic
    return {arm: topic for arm, (_, topic) in found.items()}


def _tips(bag: RosBag, topic: str) -> Stream:
    """Return the poses of a tip, by the time from the start of the bag."""
    read = _from_joints if topic.endswith("measured_js") else _from_pose
    times: list[int] = []
    poses: list[Vector] = []
    for _, time_ns, message in bag.messages([topic], bag.start_ns):
        try:
            pose = read(message)
        except (AttributeError, TypeError, ValueError) as error:
            raise RecordingError(f"'{bag.path}': topic '{topic}' at {time_ns} ns: {error}") from error
        if problem := _problem(pose):
            raise RecordingError(f"'{bag.path}': topic '{topic}' at {time_ns} ns: {problem}")
        times.append(time_ns - bag.start_ns)
        poses.append(pose)
    return Stream(np.array(times, np.int64), np.stack(poses), _PERIOD_NS)


def _problem(pose: Vector) -> str:
    """Return why position and quaternion, shape (7,), are no pose of an instrument; empty: valid."""
    if not np.isfinite(pose).all():
        return "not all numbers are finite"
    if np.abs(pose).max() > MAGNITUDES["m"].most:
        return f"a size of {np.abs(pose).max():g} is no place of an instrument"
    if not _LEAST_NORM < np.linalg.norm(pose[3:]) < _GREATEST_NORM:
        return f"the quaternion has norm {np.linalg.norm(pose[3:]):g} instead of 1"
    return ""


def _from_pose(message: Any) -> Vector:
    at, turn = message.pose.position, message.pose.orientation
    return np.array([at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w])


def _from_joints(message: Any) -> Vector:
    pose = _CHAIN.forward(np.asarray(message.position, np.float64)[:6])
    return np.concatenate([pose[:3, 3], rotation.from_matrix(pose)])
