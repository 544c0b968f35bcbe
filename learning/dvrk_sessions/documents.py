"""The JSON documents of a session: index, sidecars of videos, tags, in the types of dvrk_data 1.0.0.

Read from jhu-dvrk/dvrk_data (share/schemas/video_sidecar.schema.json and session_tags.schema.json;
src/record/video_stream.cpp and ui.cpp). Fields without a meaning in a simulation are null, zero or empty, as
the schemas allow.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any, NamedTuple

from hub.recording.dvrk_session import BAG, INDEX_TYPE

__all__ = ["Frame", "Tag", "index", "session_tags", "video_sidecar"]

_SIDECAR_TYPE = "dvrk_data:video_sidecar@1.0.0"
_TAGS_TYPE = "dvrk_data:session_tags@1.0.0"
_LONGEST_GAP_NS = 500_000_000
"""Times from frame to frame beyond this are not counted in the duration of a video."""


class Frame(NamedTuple):
    """Simulated times of a frame, ns."""

    taken_ns: int
    arrived_ns: int
    """When the picture came out of its camera."""


class Tag(NamedTuple):
    """An event of a session."""

    name: str
    time_ns: int
    """Simulated time."""


def index(videos: Mapping[str, Sequence[Frame]]) -> dict[str, Any]:
    """Return `index.json` for frames by name of the video."""
    return {
        "rosbags": BAG,
        "streams": [
            {
                "name": name,
                "videos": [{"duration": _duration_s(frames), "file": f"{name}.mp4", "frames": len(frames)}],
            }
            for name, frames in videos.items()
        ],
        "type": INDEX_TYPE,
    }


def _duration_s(frames: Sequence[Frame]) -> float:
    gaps = (after.taken_ns - before.taken_ns for before, after in pairwise(frames))
    return sum(gap for gap in gaps if 0 < gap < _LONGEST_GAP_NS) / 1e9


def video_sidecar(eye: str, frames: Sequence[Frame], start_ns: int) -> dict[str, Any]:
    """Return the sidecar of the video of one eye, `left` or `right`.

    `start_ns`: wall time of simulated time 0, ns since 1970.
    """
    return {
        "clock_domains": {
            "cpu_monotonic": {"clock": "CLOCK_MONOTONIC", "epoch": "unspecified", "unit": "ns"},
            "cpu_realtime": {"clock": "CLOCK_REALTIME", "epoch": "unix", "unit": "ns"},
            "gst_clock": {"unit": "ns"},
        },
        "config_files": [],
        "end_cpu_realtime_ns": start_ns + frames[-1].arrived_ns,
        "estimated_latency_ms": 0.0,
        "frames": [_frame(eye, i, frame, frames[0], start_ns) for i, frame in enumerate(frames)],
        "frames_dropped": 0,
        "frames_recorded": len(frames),
        "side_by_side": "undefined",
        "start_cpu_realtime_ns": start_ns + frames[0].arrived_ns,
        "stream_name": eye,
        "timestamp_statistics": {"at_reception": 0, "from_unixfd": len(frames)},
        "type": _SIDECAR_TYPE,
        "video_file": f"{eye}.mp4",
    }


def _frame(eye: str, i: int, frame: Frame, first: Frame, start_ns: int) -> dict[str, Any]:
    since_first_ns = frame.taken_ns - first.taken_ns
    realtime: dict[str, int | None] = dict.fromkeys(("mono", "left", "right"))
    realtime[eye] = start_ns + frame.taken_ns
    return {
        "cpu": {
            "monotonic": {"recorder_reception_ns": frame.arrived_ns},
            "realtime": {
                **{f"{source}_source_ns": time_ns for source, time_ns in realtime.items()},
                "overlay_output_ns": None,
                "recorder_reception_ns": start_ns + frame.arrived_ns,
                "stereo_output_ns": None,
            },
        },
        "frame_index": i,
        "gst": {
            "clock_time_ns": None,
            "dts_ns": None,
            "duration_ns": None,
            "pts_ns": since_first_ns,
            "running_time_ns": since_first_ns,
            "stream_time_ns": since_first_ns,
        },
    }


def session_tags(stage: str, end_ns: int, tags: Iterable[Tag], start_ns: int) -> dict[str, Any]:
    """Return `session_tags.json`: the session as one stage until simulated time `end_ns`, and its events."""

    def instant(time_ns: int) -> dict[str, Any]:
        return {"cpu_ts": start_ns + time_ns, "generated_at": _civil_time(start_ns + time_ns)}

    occurrences: dict[str, list[dict[str, Any]]] = {}
    for tag in tags:
        occurrences.setdefault(tag.name, []).append(instant(tag.time_ns))
    return {
        "generated_at": _civil_time(start_ns + end_ns),
        "stages": [{"end": instant(end_ns), "name": stage, "start": instant(0)}],
        "tags": occurrences,
        "type": _TAGS_TYPE,
    }


def _civil_time(wall_ns: int) -> str:
    """Return `2026-07-12T20:15:30.123`, in UTC, so that an export is the same everywhere."""
    whole = datetime.fromtimestamp(wall_ns // 1_000_000_000, UTC).strftime("%Y-%m-%dT%H:%M:%S")
    return f"{whole}.{wall_ns // 1_000_000 % 1000:03d}"
