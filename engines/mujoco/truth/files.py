"""Truth as files: 16-bit PNG for what has whole numbers, NumPy's npz for what has not, and JSON.

depth.png            0.1 mm, 16 bits; 0: nothing
segmentation.png     class, 16 bits (`SceneClass`); bodies.png, instances.png: numbers in truth.json
truth.npz            float32: depth (m), normals, flow (px), scene_flow (m); flow_visible (bool)
truth.json           camera, classes, bodies, poses, instruments with keypoints
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from engines.mujoco.truth.keypoints import InstrumentView
from engines.mujoco.truth.labels import Body
from engines.mujoco.truth.modality import Modality
from engines.mujoco.truth.recorded_truth import TruthFrame
from engines.mujoco.truth.scene_class import SceneClass
from engines.mujoco.truth.sight import Viewpoint

__all__ = [
    "DEPTH_STEP_M",
    "camera_json",
    "depth_steps",
    "frame_json",
    "instance_picture",
    "instruments_json",
    "scene_json",
    "write_frame",
    "write_png",
]

DEPTH_STEP_M = 1e-4
"""Step of a depth.png, m."""


def write_frame(
    directory: Path,
    frame: TruthFrame,
    bodies: tuple[Body, ...],
    modalities: frozenset[Modality],
    scene: Mapping[str, Any] = MappingProxyType({}),
) -> None:
    """Write the chosen modalities of a frame into an existing directory. Raises OSError if that fails.

    `scene`: what truth.json has beside the frame's own numbers.
    """
    sight, arrays = frame.sight, dict[str, NDArray[Any]]()
    if "depth" in modalities:
        write_png(directory / "depth.png", depth_steps(sight.depth))
        arrays["depth"] = sight.depth
    if "segmentation" in modalities:
        write_png(directory / "segmentation.png", sight.classes)
        write_png(directory / "bodies.png", sight.bodies)
        write_png(directory / "instances.png", instance_picture(sight.bodies, bodies))
    if "normals" in modalities:
        arrays["normals"] = sight.normals
    if "flow" in modalities and frame.motion is not None:
        arrays["flow"], arrays["scene_flow"] = frame.motion.flow, frame.motion.scene_flow
        arrays["flow_visible"] = frame.motion.is_visible
    if arrays:
        np.savez_compressed(directory / "truth.npz", allow_pickle=False, **arrays)
    content = {**scene, **frame_json(frame, keypoints="keypoints" in modalities)}
    (directory / "truth.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def depth_steps(depth: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Return depths, m, in steps of `DEPTH_STEP_M`; farther ones than fit are the farthest that fits."""
    return np.rint(depth / DEPTH_STEP_M).clip(0, 65535).astype(np.uint16)


def write_png(file: Path, values: NDArray[np.uint16]) -> None:
    """Write a picture of 16-bit numbers, shape (height, width)."""
    Image.fromarray(values).save(file)


def instance_picture(picture: NDArray[np.uint16], bodies: tuple[Body, ...]) -> NDArray[np.uint16]:
    """Return the number of the instance in each pixel of a picture of bodies."""
    return np.array([0, *(body.instance for body in bodies)], np.uint16)[picture]


def scene_json(bodies: tuple[Body, ...]) -> dict[str, Any]:
    """Return what the numbers in the pictures of a scene mean."""
    return {
        "units": {"depth.png": "0.1 mm", "depth": "m", "flow": "px", "scene_flow": "m", "poses": "m"},
        "classes": {one.name.lower(): int(one) for one in SceneClass},
        "bodies": [body.as_json() for body in bodies],
    }


def frame_json(frame: TruthFrame, *, keypoints: bool) -> dict[str, Any]:
    """Return the camera and the poses of a frame and, if asked for, keypoints and shaft edges."""
    content: dict[str, Any] = {"time_s": frame.time_ns * 1e-9, "camera": camera_json(frame.sight.view)}
    content["camera_from_body"] = {name: pose.tolist() for name, pose in frame.poses.items()}
    content["instruments"] = instruments_json(frame.instruments, keypoints=keypoints)
    return content


def instruments_json(views: Mapping[str, InstrumentView], *, keypoints: bool) -> dict[str, Any]:
    """Return the poses of instruments by arm and, if asked for, keypoints and shaft edges."""
    return {arm: _instrument_json(view, keypoints=keypoints) for arm, view in views.items()}


def camera_json(view: Viewpoint) -> dict[str, Any]:
    """Return size, intrinsics and pose of a camera."""
    projection = view.projection
    return {
        "width": projection.size[0],
        "height": projection.size[1],
        "k": projection.intrinsics.tolist(),
        "distortion_model": "plumb_bob",
        "d": list(projection.distortion),
        "world_from_camera": view.pose.tolist(),
    }


def _instrument_json(view: InstrumentView, *, keypoints: bool) -> Mapping[str, Any]:
    content: dict[str, Any] = {"tool": view.tool, "camera_from_tip": view.tip_pose.tolist()}
    if keypoints:
        content["keypoints"] = {
            name: {
                "pixel": None if np.isnan(point.pixel).any() else point.pixel.tolist(),
                "position_m": point.position.tolist(),
                "visibility": point.visibility,
            }
            for name, point in view.keypoints.items()
        }
        content["shaft_edges"] = [edge.tolist() for edge in view.shaft_edges]
    return content
