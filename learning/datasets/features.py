"""Descriptions of columns and videos in `meta/info.json` of a LeRobotDataset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from learning.datasets.pictures import EYES
from learning.datasets.video import CODEC, PIXEL_FORMAT

__all__ = ["FORMAT", "INDICES", "VIDEO_KEYS", "features", "info"]

FORMAT = "v3.0"
"""`codebase_version` of the layout (LeRobot 0.4)."""
VIDEO_KEYS = tuple(f"observation.images.{eye}" for eye in EYES)
INDICES = ("frame_index", "episode_index", "index", "task_index")
"""Columns of whole numbers of every data set: the frame in its episode, the episode, the frame in the data
set, the task.
"""


def features(
    state: Sequence[str], action: Sequence[str], size: tuple[int, int], fps: int
) -> dict[str, dict[str, Any]]:
    """Return all features by their key; `state` and `action` are names of columns, `size` width, height."""
    width, height = size
    video = {
        "dtype": "video",
        "shape": [height, width, 3],
        "names": ["height", "width", "channels"],
        "info": {
            "video.height": height,
            "video.width": width,
            "video.codec": CODEC,
            "video.pix_fmt": PIXEL_FORMAT,
            "video.is_depth_map": False,
            "video.fps": fps,
            "video.channels": 3,
            "has_audio": False,
        },
    }
    one: dict[str, Any] = {"shape": [1], "names": None}
    return {
        "observation.state": {"dtype": "float32", "shape": [len(state)], "names": list(state)},
        "action": {"dtype": "float32", "shape": [len(action)], "names": list(action)},
        **dict.fromkeys(VIDEO_KEYS, video),
        "timestamp": {"dtype": "float32", **one},
        **{key: {"dtype": "int64", **one} for key in INDICES},
    }


def info(
    described: dict[str, dict[str, Any]], fps: int, episodes: int, frames: int, tasks: int
) -> dict[str, Any]:
    """Return the content of `meta/info.json`."""
    return {
        "codebase_version": FORMAT,
        "robot_type": "dvrk",
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": fps,
        "splits": {"train": f"0:{episodes}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
        "features": described,
    }
