"""Descriptions of an Open-H data set: `info.json`, `modality.json` for GR00T-H, and the README."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from learning.datasets.episode import Episode
from learning.datasets.open_h import ARMS, META
from learning.datasets.video import CODEC, PIXEL_FORMAT
from robots.dvrk.crtk import CAMERA_FRAME
from robots.policies.states import state_groups
from schemas.readable import counted

__all__ = ["CHUNK", "FORMAT", "Counts", "info", "modality", "readme"]

FORMAT = "v2.1"
CHUNK = 1000
"""Episodes in a directory."""
STATISTICS = ("min", "max", "mean", "std", "count")
"""Statistics of format v2.1."""
_SPLITS = (("train", 0.0, 0.8), ("val", 0.8, 0.9), ("test", 0.9, 1.0))
"""Name, begin and end of each split, as shares of the episodes."""


class Counts(NamedTuple):
    """Sizes of a data set."""

    episodes: int
    frames: int
    tasks: int


def info(
    first: Episode, fps: int, size: tuple[int, int], videos: Sequence[str], counts: Counts
) -> dict[str, Any]:
    """Return the content of `meta/info.json`; `first` has the columns of all episodes."""
    width, height = size
    one: dict[str, Any] = {"shape": [1], "names": None}
    video = {
        "dtype": "video",
        "shape": [height, width, 3],
        "names": ["height", "width", "channel"],
        "info": {
            "video.fps": fps,
            "video.height": height,
            "video.width": width,
            "video.channels": 3,
            "video.codec": CODEC,
            "video.pix_fmt": PIXEL_FORMAT,
            "video.is_depth_map": False,
            "has_audio": False,
        },
    }
    numbers = {"observation.state": first.state_names, "action": first.action_names}
    numbers |= {name: columns for name, (columns, _) in first.meta.items()}
    text = {"dtype": "string", "shape": [1], "names": ["value"]}
    whole = {
        "codebase_version": FORMAT,
        "robot_type": "dvrk",
        "chunks_size": CHUNK,
        "fps": fps,
        "tolerance_s": 1e-4,
        "frame": first.frame,
        "units": {"position": "m", "jaw": "rad", "force": "N", "torque": "N m"},
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
        "video_path": "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
        "features": {
            **dict.fromkeys(videos, video),
            **{
                name: {"dtype": "float32", "shape": [len(names)], "names": list(names)}
                for name, names in numbers.items()
            },
            **dict.fromkeys(first.texts, text),
            "instruction.text": text | {"description": "the task in words, or the present sub-task"},
            "timestamp": {"dtype": "float32", **one},
            **{
                key: {"dtype": "int64", **one}
                for key in ("frame_index", "episode_index", "index", "task_index")
            },
        },
    }
    return with_counts(whole, counts)


def with_counts(info: Mapping[str, Any], counts: Counts) -> dict[str, Any]:
    """Return the content of `info.json` for other counts of episodes."""
    videos = sum(feature["dtype"] == "video" for feature in info["features"].values())
    return {
        **info,
        "total_episodes": counts.episodes,
        "total_frames": counts.frames,
        "total_tasks": counts.tasks,
        "total_videos": counts.episodes * videos,
        "total_chunks": -(-counts.episodes // CHUNK),
        "splits": _splits(counts.episodes),
    }


def _splits(episodes: int) -> dict[str, str]:
    """Return ranges of episodes; a small data set is all for training."""
    cuts = {share: int(share * episodes) if episodes >= len(ARMS) * 5 else episodes for share in (0.8, 0.9)}
    cuts |= {0.0: 0, 1.0: episodes}
    return {name: f"{cuts[begin]}:{cuts[end]}" for name, begin, end in _SPLITS}


def modality(info: Mapping[str, Any]) -> dict[str, Any]:
    """Return the groups of state and action as GR00T-H names them, with the left camera of the endoscope.

    `info` is the content of `info.json`.
    """
    groups: dict[str, dict[str, int]] = {}
    at = 0
    for arm in _arms(info):
        for group in state_groups("open-h-dvrk", arm, "", ()):
            groups[group.name] = {"start": at, "end": at + len(group.fields)}
            at += len(group.fields)
    return {
        "state": groups,
        "action": groups,
        "video": {"endoscope_left": {"original_key": "observation.images.endoscope.left"}},
        "annotation": {"human.task_description": {"original_key": "task_index"}},
    }


def _arms(info: Mapping[str, Any]) -> list[str]:
    """Return the arms of a row, in order."""
    names = info["features"]["observation.state"]["names"]
    return list(dict.fromkeys(name.partition("_")[0].upper() for name in names))


def readme(info: Mapping[str, Any], tasks: Sequence[str]) -> str:
    """Return the README in the sections that Open-H asks for; `info` is the content of `info.json`."""
    features, fps, arms = info["features"], info["fps"], _arms(info)
    absent = [arm for arm in ARMS if f"{META}tool.{arm.lower()}" not in features]
    truths = "".join(
        f"- `{name}`: {feature['shape'][0]} numbers\n"
        for name, feature in features.items()
        if name.startswith(META) and feature["dtype"] == "float32"
    )
    height, width, _ = next(one["shape"] for one in features.values() if one["dtype"] == "video")
    hours = f"{info['total_frames'] / fps / 3600:.3f}"
    frame = f"`{info['frame']}`{', the tip of the endoscope' if info['frame'] == CAMERA_FRAME else ''}"
    done = "".join(f"- {task}\n" for task in tasks)
    missing = f" {', '.join(absent)} is not in the scene: its numbers are constant." if absent else ""
    return f"""# Simulated demonstrations on a dVRK

## Dataset Description

{counted(info["total_episodes"], "episode")}, {counted(info["total_frames"], "frame")}, {hours} hours.
Data type: physical simulation (Trocar). License: chosen by the publisher.

{done}
## Collection Procedure

Programmatic or teleoperated, as `recordings.json` or `sources.jsonl` says of each episode; each recording
simulates again to the same bits. No episode shows a recovery unless its task says so.

## Robot Platform

Simulated da Vinci Research Kit: patient-side manipulators {" and ".join(arms)}, endoscope.{missing}

## Sensors & Cameras

Stereo endoscope, {width} x {height} pixels, {fps} frames a second. Truths of the simulation:

{truths}
## Action & State Space Representation

Absolute Cartesian set-points (action) and measured poses (state) of {", then ".join(arms)}: x, y, z in m,
quaternion x, y, z, w, jaw in rad. Reference frame: {frame}.
The action of a frame is the set-point at the time of the next frame.

## Data Synchronization

All numbers and pictures have the clock of the simulation: state and pictures are those of the frame's time,
without interpolation and without skew; timestamps are exact multiples of the frame time.
"""
