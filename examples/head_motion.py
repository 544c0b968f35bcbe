"""Write the surgeon's head of the scenario teleop as a rosbag2 directory.

Its topics are pose, velocity, and the mode of the camera (turn or move).

    python examples/head_motion.py configs/data/head

The head looks left, right, up and back, leans to its right shoulder, comes nearer and goes back. Each
movement is of minimum jerk (Flash and Hogan 1985, J. Neurosci. 5(7), eq. 3), slower than the endoscope's
joints may move. Axes are those of REP 103 (x ahead, y left, z up) in the base frame and in the head's own,
which start as one.
"""

from __future__ import annotations

import shutil
import sys
from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from trocar import write_bag
from trocar.messages import (
    Header,
    Message,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    StringMessage,
    Time,
    Twist,
    TwistStamped,
    Vector3,
)

RATE_HZ = 100
FRAME = "head_base"
WAYS: list[tuple[float, str, float]] = [
    (0.5, "yaw", 0.0),
    (1.6, "yaw", 0.3),
    (0.4, "yaw", 0.3),
    (2.8, "yaw", -0.3),
    (0.4, "yaw", -0.3),
    (1.6, "yaw", 0.0),
    (1.4, "pitch", -0.2),
    (0.3, "pitch", -0.2),
    (1.4, "pitch", 0.0),
    (1.4, "roll", 0.25),
    (0.3, "roll", 0.25),
    (1.4, "roll", 0.0),
    (0.5, "x", 0.0),
    (2.4, "x", 0.06),
    (0.6, "x", 0.06),
    (2.4, "x", 0.0),
    (0.6, "x", 0.0),
]
"""Seconds, what moves, and where it is then (rad, m): 20 s.

One at a time and from the middle, so each turns about an axis of the base frame.
"""
AXES = ("roll", "pitch", "yaw", "x")


def motion() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return roll, pitch, yaw (rad) and x (m) at each sample, shape (n, 4), and their rates, shape (n, 4)."""
    values, rates, at = [np.zeros((1, 4))], [np.zeros((1, 4))], np.zeros(4)
    for seconds, axis, end in WAYS:
        way = np.zeros(4)
        way[AXES.index(axis)] = end - at[AXES.index(axis)]
        s = np.arange(1, round(seconds * RATE_HZ) + 1)[:, None] / round(seconds * RATE_HZ)  # (k, 1)
        values.append(at + way * (10 * s**3 - 15 * s**4 + 6 * s**5))
        rates.append(way / seconds * (30 * s**2 - 60 * s**3 + 30 * s**4))
        at = at + way
    return np.concatenate(values), np.concatenate(rates)


def turned(vector: NDArray[np.float64]) -> Quaternion:
    """Return the rotation vector `vector`, rad, as a quaternion."""
    angle = float(np.linalg.norm(vector))
    x, y, z = (vector * (sin(angle / 2) / angle if angle > 1e-6 else 0.5)).tolist()
    return Quaternion(x=x, y=y, z=z, w=cos(angle / 2))


def messages() -> list[tuple[str, int, Message]]:
    """Return (topic, time in ns, message), oldest first."""
    values, rates = motion()
    found: list[tuple[str, int, Message]] = [("/mode", 0, StringMessage(data="orientation"))]
    nearer = next(k for k, rate in enumerate(rates) if rate[3])
    for k, (value, rate) in enumerate(zip(values, rates, strict=True)):
        time_ns = k * 10**9 // RATE_HZ
        header = Header(stamp=Time.from_ns(time_ns), frame_id=FRAME)
        pose = Pose(position=Point(x=float(value[3])), orientation=turned(value[:3]))
        twist = Twist(
            linear=Vector3(x=float(rate[3])),
            angular=Vector3(x=float(rate[0]), y=float(rate[1]), z=float(rate[2])),
        )
        if k == nearer - 1:
            found.append(("/mode", time_ns, StringMessage(data="position")))
        found += [
            ("/pose", time_ns, PoseStamped(header=header, pose=pose)),
            ("/twist", time_ns, TwistStamped(header=header, twist=twist)),
        ]
    return found


if __name__ == "__main__":
    shutil.rmtree(sys.argv[1], ignore_errors=True)
    write_bag(sys.argv[1], messages())
