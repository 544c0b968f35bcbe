"""Joint states of an arm from recordings: our MCAP, a ROS bag of either version, or a CSV file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hub.recording.ros_bag_reader import RosBag
from robots.dvrk.own_dynamics import JAW
from robots.identification.signals import Measured
from schemas.errors import RecordingError, did_you_mean
from schemas.user_files import read_number_table
from schemas.vectors import Vector

__all__ = ["has_jaw", "measurements"]

_TOPIC = "measured_js"


def measurements(path: Path, arm: str, joints: Sequence[str], owner: str = "") -> Measured:
    """Return the states of n joints of `arm` as recorded in `path`, by receipt or message time.

    A bag has `<arm>/measured_js` at the end of a topic, and `<arm>/jaw/measured_js` for a jaw as the last
    joint; `owner` is the participant of a session with the topics that count. A CSV file has a line of
    names: `time` (s), `position.<joint>` (rad, m) and `effort.<joint>` (N m, N), the joints in any order.
    Raises RecordingError where the topic, a column or the effort is missing.
    """
    return (
        _of_csv(path, joints)
        if path.suffix == ".csv"
        else _of_bag(path, f"{owner}/{arm}" if owner else arm, joints)
    )


def _of_csv(path: Path, joints: Sequence[str]) -> Measured:
    names, table = read_number_table(path)
    wanted = ["time", *(f"{part}.{joint}" for part in ("position", "effort") for joint in joints)]
    for name in wanted:
        if name not in names:
            raise RecordingError(f"'{path}' has no column '{name}'.{did_you_mean(name, names)}")
    columns = table[:, [names.index(name) for name in wanted]]
    return Measured(columns[:, 0], columns[:, 1 : 1 + len(joints)], columns[:, 1 + len(joints) :])


def has_jaw(path: Path, arm: str) -> bool:
    """Return whether `path` has states of the jaw of `arm`."""
    if path.suffix == ".csv":
        return f"effort.{JAW}" in read_number_table(path)[0]
    with RosBag(path) as bag:
        return bool(_topics(bag, f"{arm}/{JAW}/{_TOPIC}"))


def _topics(bag: RosBag, ending: str) -> list[str]:
    return [name for name in bag.topics if f"/{name}".endswith(f"/{ending}")]


def _of_bag(path: Path, arm: str, joints: Sequence[str]) -> Measured:
    with RosBag(path) as bag:
        parts = [_states(path, bag, f"{arm}/{_TOPIC}", len(joints) - (JAW in joints))]
        if JAW in joints:
            jaw = _states(path, bag, f"{arm}/{JAW}/{_TOPIC}", 1)
            clock = parts[0].time
            parts.append(
                jaw._replace(position=_at(clock, jaw, jaw.position), effort=_at(clock, jaw, jaw.effort))
            )
    return Measured(
        parts[0].time,
        np.hstack([part.position for part in parts]),
        np.hstack([part.effort for part in parts]),
    )


def _at(clock: Vector, states: Measured, values: Vector) -> Vector:
    return np.interp(clock, states.time, values[:, 0])[:, None]


def _states(path: Path, bag: RosBag, ending: str, count: int) -> Measured:
    """Return the first `count` numbers of the joint states on the topic ending in `ending`.

    Of several, such as an engine's and its controller's, the topic with the most messages counts.
    """
    times: list[float] = []
    states: list[tuple[Any, Any]] = []
    found = _topics(bag, ending)
    most = max((bag.topics[name].messages for name in found), default=0)
    found = [name for name in found if bag.topics[name].messages == most]
    if len(found) != 1:
        raise RecordingError(
            f"'{path}' has {len(found) or 'no'} topics that end in '{ending}', one is needed."
            f"{did_you_mean(ending, bag.topics)}"
        )
    for _, time_ns, message in bag.messages(found, bag.start_ns):
        if isinstance(message, Exception):
            raise RecordingError(f"'{path}': a message of '{found[0]}' is damaged: {message}") from message
        state: Any = message
        if len(state.position) < count or len(state.effort) < count:
            raise RecordingError(
                f"'{path}': '{found[0]}' has {len(state.position)} positions and {len(state.effort)}"
                f" efforts, {count} of each are needed"
            )
        times.append((time_ns - bag.start_ns) * 1e-9)
        states.append((state.position[:count], state.effort[:count]))
    values = np.array(states, np.float64).reshape(-1, 2, count)
    return Measured(np.array(times), values[:, 0], values[:, 1])
