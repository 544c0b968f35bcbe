"""Instructions of an episode: what is to be done in each frame, in words."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

from schemas.ros import StringMessage
from trocar import Recording

__all__ = ["instructions"]


def instructions(recording: Recording, times_ns: NDArray[np.int64], task: str) -> NDArray[np.str_]:
    """Return the text of each frame, shape (n,): the newest of an output `instruction`, else the task.

    A routine with sub-tasks has such an output, of std_msgs/String. Frames before the first instruction have
    the first one. Raises RecordingError for an invalid message.
    """
    for port, ros_type in recording.ports.items():
        if port.partition(".")[2] == "instruction" and ros_type == StringMessage.ros_type:
            told = [(t, cast("StringMessage", said).data) for t, said in recording[port].messages()]
            if told:
                begins = np.array([round(1e9 * t) for t, _ in told], np.int64)
                newest = np.searchsorted(begins, times_ns, side="right") - 1
                return np.array([text for _, text in told])[newest.clip(min=0)]
    return np.full(len(times_ns), task)
