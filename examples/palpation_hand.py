"""Write the hand path of the palpation scenario: stylus poses at 250 Hz as a rosbag2 directory.

    python examples/palpation_hand.py configs/data/palpation_hand

Each way point is reached by a minimum-jerk movement (Flash and Hogan 1985, J. Neurosci. 5(7), eq. 3): the
hand path of an undisturbed reach. The z axis points up; positions are relative to where the hand starts, in
millimetres of the probe; teleoperation scales the hand down by `SCALE`.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from trocar import write_bag
from trocar.messages import Header, Point, Pose, PoseStamped, Time

RATE_HZ = 250
SCALE = 0.2
"""Probe motion over hand motion: dVRK's default for teleoperation."""
RESOLUTION_M = 2.0**-20
"""About 1 um: finer than a hand can tell, and short mantissas compress well."""
CONTACT_MM = -5.0
"""In configs/palpation.yaml the probe, a sphere of 5 mm radius, starts with its centre 10 mm above the
tissue.
"""
HOVER_MM = CONTACT_MM + 1.5


def way_points() -> list[tuple[float, float, float]]:
    """Return (seconds, x in mm, z in mm) of each way point.

    Approach, three presses of growing depth, a drag along the surface, retreat.
    """
    points = [(0.5, 0.0, 0.0), (2.0, 0.0, HOVER_MM)]
    for depth_mm, seconds in ((2.0, 1.2), (4.0, 1.4), (6.0, 1.6)):
        points += [
            (seconds, 0.0, CONTACT_MM - depth_mm),
            (0.7, 0.0, CONTACT_MM - depth_mm),
            (seconds, 0.0, HOVER_MM),
        ]
    points += [(1.2, 0.0, CONTACT_MM - 3.0), (3.0, 20.0, CONTACT_MM - 3.0), (1.2, 20.0, HOVER_MM)]
    return [*points, (1.4, 20.0, 0.0), (0.2, 20.0, 0.0)]


def hand_path() -> NDArray[np.float64]:
    """Return hand positions in metres, shape (n, 3), frame `stylus_base`."""
    pieces, start = [np.zeros((1, 3))], np.zeros(3)
    for seconds, x_mm, z_mm in way_points():
        end = np.array([x_mm, 0.0, z_mm]) * 1e-3 / SCALE
        s = np.arange(1, round(seconds * RATE_HZ) + 1)[:, None] / round(seconds * RATE_HZ)  # (k, 1)
        pieces.append(start + (end - start) * (10 * s**3 - 15 * s**4 + 6 * s**5))
        start = end
    return np.round(np.concatenate(pieces) / RESOLUTION_M) * RESOLUTION_M


def messages() -> Iterator[tuple[str, int, PoseStamped]]:
    """Yield (topic, time in ns, message), oldest first."""
    for index, (x, y, z) in enumerate(hand_path()):
        time_ns = index * 10**9 // RATE_HZ
        header = Header(stamp=Time.from_ns(time_ns), frame_id="stylus_base")
        yield "/pose", time_ns, PoseStamped(header=header, pose=Pose(position=Point(x=x, y=y, z=z)))


if __name__ == "__main__":
    shutil.rmtree(sys.argv[1], ignore_errors=True)
    write_bag(sys.argv[1], messages())
