"""Targets of a simulated hand: on a path of waypoints, or of a recorded hand.

Between two waypoints the hand moves as people reach: along a straight line, with the least jerk and at rest
at both ends (Flash and Hogan, The coordination of arm movements, Journal of Neuroscience 5(7), 1985). Between
two recorded poses the hand moves evenly. The rotation is about a single axis, with the same course in time.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from devices.haptics.contact import ZERO
from devices.simulated_touch.params import LEVEL, Waypoint
from devices.vendor_axes import Quaternion, Vector3
from hub.recording.bag import Bag
from robots import rotation
from schemas.codec import decode
from schemas.errors import RecordingError
from schemas.ros import Joy, PoseStamped

__all__ = ["HandPath", "recorded_path", "waypoint_path"]

_Buttons = tuple[bool, bool]
_RELEASED = (False, False)


class _Stop(NamedTuple):
    time: float
    position: Vector3
    orientation: Quaternion


class _Press(NamedTuple):
    time: float
    buttons: _Buttons


class HandPath:
    """A path in the stylus' base frame, m and rad, over time in s.

    Before the time of the first stop the hand is at the stop's pose, without a button.
    """

    def __init__(
        self,
        stops: Sequence[_Stop],
        presses: Sequence[_Press],
        course: Callable[[float], tuple[float, float]],
    ) -> None:
        """`course`: share of the way between two stops, and the derivative, at a share of the time."""
        self._stops, self._presses, self._course = stops, presses, course
        self._times = [stop.time for stop in stops]
        self._pressed_at = [press.time for press in presses]
        self._turning: tuple[_Stop, _Stop] | None = None
        """Stops before and after the rotation by `_turn`, a rotation vector (rad)."""
        self._turn = np.zeros(3)

    def position(self, t: float) -> tuple[Vector3, Vector3]:
        """Return the target's position (m) and velocity (m/s)."""
        before, after, share, rate = self._between(t)
        (ax, ay, az), (bx, by, bz) = before.position, after.position
        x, y, z = bx - ax, by - ay, bz - az
        return (ax + share * x, ay + share * y, az + share * z), (rate * x, rate * y, rate * z)

    def orientation(self, t: float) -> tuple[Quaternion, Vector3]:
        """Return the orientation (x, y, z, w), and the angular velocity (rad/s), both in the base frame."""
        before, after, share, rate = self._between(t)
        start = np.array(before.orientation)
        if self._turning != (before, after):
            goal = np.array(after.orientation)
            self._turn = rotation.log(rotation.product(goal, rotation.conjugate(start)))
            self._turning = before, after
        turn = self._turn
        x, y, z, w = rotation.product(rotation.exp(share * turn), start).tolist()
        wx, wy, wz = (rate * turn).tolist()
        return (x, y, z, w), (wx, wy, wz)

    def buttons(self, t: float) -> _Buttons:
        """Return whether each of the two buttons is held."""
        index = bisect_right(self._pressed_at, t) - 1
        return self._presses[index].buttons if index >= 0 else _RELEASED

    def _between(self, t: float) -> tuple[_Stop, _Stop, float, float]:
        """Return the stops before and after `t`, the share of the way done, and the share's rate (1/s)."""
        index = bisect_right(self._times, t) - 1
        if index < 0 or index == len(self._times) - 1:
            stop = self._stops[max(index, 0)]
            return stop, stop, 0.0, 0.0
        before, after = self._stops[index], self._stops[index + 1]
        length = after.time - before.time
        share, rate = self._course((t - before.time) / length)
        return before, after, share, rate / length


def waypoint_path(waypoints: Sequence[Waypoint]) -> HandPath:
    """Return the path through at least one waypoint, in order of their times."""
    stops: list[_Stop] = []
    presses: list[_Press] = []
    position, orientation = ZERO, LEVEL
    for waypoint in waypoints:
        position, orientation = waypoint.position or position, waypoint.orientation or orientation
        stops.append(_Stop(waypoint.at * 1e-9, position, orientation))
        if waypoint.buttons is not None:
            presses.append(_Press(waypoint.at * 1e-9, (0 in waypoint.buttons, 1 in waypoint.buttons)))
    return HandPath(stops, presses, _least_jerk)


def recorded_path(file: Path, stylus: str, dead_man: int) -> HandPath:
    """Return the path of the hand in a recording, from the first pose on.

    Without recorded buttons the hand holds the dead-man. Of several topics with poses (or with buttons) the
    topic of this stylus is used: `.../<stylus>/pose`. Raises RecordingError if there is none.
    """
    bag = Bag(file)
    poses, joys = (
        _topic(bag, PoseStamped.ros_type, f"{stylus}/pose"),
        _topic(bag, Joy.ros_type, f"{stylus}/buttons"),
    )
    if poses is None:
        raise RecordingError(
            f"'{bag.file}' has neither exactly one topic of poses nor one that ends in '{stylus}/pose', for"
            " the hand to follow"
        )
    moves = [(m.time_ns, decode(PoseStamped, m.payload).pose) for m in bag.messages(poses)]
    if not moves:
        raise RecordingError(f"'{bag.file}' has no pose on '{poses}' for the hand to follow")
    start_ns = min(time_ns for time_ns, _ in moves)
    stops: list[_Stop] = []
    for time_ns, pose in sorted(moves, key=lambda move: move[0]):
        p, q = pose.position, pose.orientation
        stops.append(_Stop((time_ns - start_ns) * 1e-9, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w)))
    presses = [_Press(0.0, (dead_man == 0, dead_man == 1))]
    if joys is not None:
        events = sorted(
            ((m.time_ns, decode(Joy, m.payload).buttons.tolist()) for m in bag.messages(joys)),
            key=lambda event: event[0],
        )
        presses = [
            _Press((time_ns - start_ns) * 1e-9, (any(held[:1]), any(held[1:2]))) for time_ns, held in events
        ]
    return HandPath(stops, presses, lambda share: (share, 1.0))


def _topic(bag: Bag, kind: str, end: str) -> str | None:
    """Return the only topic of this type, or the only topic of this type and end."""
    found = [topic for topic, type_ in bag.topics.items() if type_ == kind]
    own = [topic for topic in found if f"/{topic}".endswith(f"/{end}")]
    return own[0] if len(own) == 1 else found[0] if len(found) == 1 else None


def _least_jerk(s: float) -> tuple[float, float]:
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s * s * (1.0 - s) * (1.0 - s)
