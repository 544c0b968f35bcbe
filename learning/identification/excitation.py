"""An exciting motion as a recording for a session to play: CRTK's `servo_jp` of an arm and its jaw."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from robots.dvrk.own_dynamics import JAW
from robots.identification.excitation import Excitation
from trocar import write_bag
from trocar.messages import JointState

__all__ = ["write_excitation"]


def write_excitation(directory: Path, arm: str, joints: list[str], motion: Excitation) -> None:
    """Write `motion` of the joints of `arm` as a rosbag2 directory. Raises RecordingError if it exists."""
    write_bag(directory, _messages(arm, joints, motion))


def _messages(arm: str, joints: list[str], motion: Excitation) -> Iterator[tuple[str, int, JointState]]:
    own = [i for i, joint in enumerate(joints) if joint != JAW]
    jaw = [i for i, joint in enumerate(joints) if joint == JAW]
    for time, q, dq in zip(motion.time.tolist(), motion.q, motion.dq, strict=True):
        for topic, columns in ((f"/{arm}/servo_jp", own), (f"/{arm}/jaw/servo_jp", jaw)):
            if columns:
                names = [joints[i] for i in columns]
                yield (
                    topic,
                    round(time * 1e9),
                    JointState(name=names, position=q[columns], velocity=dq[columns]),
                )
