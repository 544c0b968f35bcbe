"""Write the topics of a real dVRK in the scenarios `ros-masters` and `ros-mirror` as rosbag2 directories.

    python examples/ros_recordings.py configs/data

`masters`: a surgeon at the console, who homes the arms. Both masters are published at 100 Hz, as by a dVRK;
the right one moves twice to the right, with the clutch pressed on its way back, and closes its
gripper; at last both drag the picture to the right with the camera pedal pressed. `real_arms`: PSM1 and ECM,
moving. All movements are of minimum jerk (Flash and Hogan 1985, J. Neurosci. 5(7), eq. 3), so that velocities
are those of the positions.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from trocar import chain, write_bag
from trocar.messages import (
    BoolMessage,
    EmptyMessage,
    Header,
    JointState,
    Joy,
    Message,
    OperatingState,
    Point,
    Pose,
    PoseStamped,
    Time,
)

RATE_HZ = 100
Rows = Iterator[tuple[float, str, Message]]
"""Time (s), topic, message."""


def between(times: tuple[float, ...], values: list[list[float]], t: float) -> tuple[np.ndarray, np.ndarray]:
    """Return position and velocity at `t` (s) on a way that is at `values` at `times`."""
    i = min(max(int(np.searchsorted(times, t, side="right")) - 1, 0), len(times) - 2)
    length, start, way = (
        times[i + 1] - times[i],
        np.array(values[i]),
        np.array(values[i + 1]) - np.array(values[i]),
    )
    s = min(max((t - times[i]) / length, 0.0), 1.0)
    return (
        start + way * (10 * s**3 - 15 * s**4 + 6 * s**5),
        way * (30 * s**2 - 60 * s**3 + 30 * s**4) / length,
    )


def names(arm: str) -> tuple[str, ...]:
    """Return the names of the joints of an arm."""
    return tuple(joint.name for joint in chain(arm).joints)


def joints(
    names: tuple[str, ...], times: tuple[float, ...], values: list[list[float]], t: float
) -> JointState:
    """Return the joints of a real arm at `t` (s)."""
    position, velocity = between(times, values, t)
    return JointState(name=list(names), position=position, velocity=velocity, effort=np.zeros(len(names)))


def masters() -> Rows:
    """Yield the console of a surgeon, 8 s."""
    for master in ("MTML", "MTMR"):
        yield 0.0, f"/{master}/operating_state", OperatingState(state="ENABLED", is_homed=True)
    yield 0.05, "/system/home", EmptyMessage()
    yield 0.1, "/console/teleop/enable", BoolMessage(data=True)
    pedals = (
        (0.2, "operatorpresent", 1),
        (4.0, "clutch", 1),
        (5.0, "clutch", 0),
        (6.6, "camera", 1),
        (7.8, "camera", 0),
    )
    for t, pedal, pressed in pedals:
        yield t, f"/footpedals/{pedal}", Joy(buttons=np.array([pressed], np.int32))
    for t in np.arange(0, 8 * RATE_HZ) / RATE_HZ:
        right, _ = between(
            (0.0, 2.5, 3.8, 4.1, 4.9, 5.2, 6.5, 8.0),
            [[x, 0.0, 0.0] for x in (0.0, 0.0, -0.05, -0.05, 0.0, 0.0, -0.05, -0.05)],
            t,
        )
        both, _ = between((0.0, 6.7, 7.7, 8.0), [[x, 0.0, 0.0] for x in (0.0, 0.0, -0.03, -0.03)], t)
        for master, way in (("MTML", both), ("MTMR", both + right)):
            # x is to the left in the display, y up, z ahead
            position = np.array([0.12 if master == "MTML" else -0.12, -0.1, 0.3]) + way
            pose = Pose(position=Point(**dict(zip("xyz", position.tolist(), strict=True))))
            yield t, f"/{master}/measured_cp", PoseStamped(pose=pose)
            closing = [[1.0], [1.0], [0.2], [0.2]] if master == "MTMR" else [[1.0]] * 4
            yield t, f"/{master}/gripper/measured_js", joints(("gripper",), (0.0, 2.5, 3.5, 8.0), closing, t)


def real_arms() -> Rows:
    """Yield two arms that move, 6 s."""
    times = (0.0, 0.5, 2.0, 3.5, 5.0, 6.0)
    for t in np.arange(0, 6 * RATE_HZ) / RATE_HZ:
        ways = (
            [0.0, 0.0, 0.12, 0.0, 0.0, 0.0],
            [0.3, -0.2, 0.15, 0.8, 0.3, -0.3],
            [-0.3, 0.1, 0.13, -0.5, 0.0, 0.4],
        )
        yield (
            t,
            "/PSM1/measured_js",
            joints(names("PSM1"), times, [ways[0], ways[0], ways[1], ways[2], ways[0], ways[0]], t),
        )
        yield (
            t,
            "/PSM1/jaw/measured_js",
            joints(("jaw",), times, [[0.0], [0.0], [0.8], [0.2], [0.0], [0.0]], t),
        )
        here, there = [0.0, 0.0, 0.12, 0.0], [0.15, 0.1, 0.14, 0.2]
        yield t, "/ECM/measured_js", joints(names("ECM"), times, [here, here, there, there, here, here], t)


def stamped(rows: Rows) -> Iterator[tuple[str, int, Message]]:
    """Yield (topic, time in ns, message), oldest first, with the times as stamps."""
    for t, topic, message in sorted(rows, key=lambda row: row[0]):
        time_ns = round(t * 1e9)
        if isinstance(header := getattr(message, "header", None), Header):
            stamp = Time.from_ns(time_ns)
            message = message.model_copy(update={"header": header.model_copy(update={"stamp": stamp})})
        yield topic, time_ns, message


if __name__ == "__main__":
    for name, rows in (("masters", masters()), ("real_arms", real_arms())):
        directory = Path(sys.argv[1]) / name
        shutil.rmtree(directory, ignore_errors=True)
        write_bag(directory, stamped(rows))
