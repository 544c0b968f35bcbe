"""The layout of the BOP benchmark: poses of rigid bodies, https://bop.felk.cvut.cz. Millimetres.

    DIR/camera.json, DIR/models/obj_000001.ply, models_info.json
    DIR/train/000000/rgb, depth, mask, mask_visib; scene_camera.json, scene_gt.json, scene_gt_info.json

A scene is one eye of one recording. Bodies are the links of instruments and the movable objects; silhouettes
end at the border of the picture.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from engines.mujoco.pictures.solid_meshes import Triangles
from engines.mujoco.truth.files import depth_steps, write_png
from engines.mujoco.truth.labels import Body
from engines.mujoco.truth.projection import Projection
from engines.mujoco.truth.recorded_truth import RecordedTruth, TruthFrame
from engines.mujoco.truth.scene_class import INSTRUMENT_CLASSES, SceneClass
from learning.datasets.annotations import Annotations, rounded
from learning.datasets.truth import Stereo
from robots.dvrk.endoscope import EYES
from schemas.errors import RecordingError

__all__ = ["Bop"]

_POSED = (*INSTRUMENT_CLASSES, SceneClass.NEEDLE, SceneClass.OBJECT)
_MM = 1000.0
_DEPTH_SCALE = 0.1
"""Step of a depth picture, mm."""
_FOLDERS = ("rgb", "depth", "mask", "mask_visib")


class Bop(Annotations):
    """Annotations in BOP's layout."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory)
        (directory / "models").mkdir(parents=True)
        self._models: dict[str, int] = {}
        self._infos: dict[str, dict[str, Any]] = {}
        self._scene, self._frame = -len(EYES), 0
        self._numbers: dict[str, int] = {}
        self._camera: dict[str, Any] = {}
        self._scenes: list[dict[str, dict[str, Any]]] = []

    def begin(self, truth: RecordedTruth, source: Mapping[str, Any]) -> None:
        """Begin a scene for each eye, and write the models of bodies not seen before.

        Raises RecordingError for cameras with lens distortion.
        """
        if any(truth.projection.distortion):
            raise RecordingError("the cameras have lens distortion, for which BOP has no place")
        self._camera = self._camera or _calibration(truth.projection)
        self._close_scenes()
        self._scene, self._frame = self._scene + len(EYES), 0
        self._scenes = [{"camera": {}, "gt": {}, "gt_info": {}} for _ in EYES]
        for number in range(len(EYES)):
            for folder in _FOLDERS:
                (self._place(number) / folder).mkdir(parents=True)
            (self._place(number) / "source.json").write_text(json.dumps(source, indent=2) + "\n", "utf-8")
        self._numbers = {
            body.name: self._model(body, truth.model(body))
            for body in truth.bodies
            if body.scene_class in _POSED
        }

    def add(self, truth: RecordedTruth, stereo: Stereo) -> None:
        """Append a frame to the scene of each eye."""
        for number, eye in enumerate(EYES):
            frame, place, name = stereo.truth[eye], self._place(number), f"{self._frame:06d}"
            Image.fromarray(stereo.pictures[eye]).save(place / "rgb" / f"{name}.png")
            write_png(place / "depth" / f"{name}.png", depth_steps(frame.sight.depth))
            scene, key = self._scenes[number], str(self._frame)
            scene["camera"][key] = _camera(frame)
            scene["gt"][key], scene["gt_info"][key] = self._objects(truth, frame, place, name)
        self._frame += 1

    def _objects(
        self, truth: RecordedTruth, frame: TruthFrame, place: Path, name: str
    ) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
        """Write the masks of a frame; return poses of bodies in it, and how they are seen."""
        poses: list[dict[str, Any]] = []
        infos: list[dict[str, Any]] = []
        for body in truth.bodies:
            if body.name not in self._numbers or not (whole := truth.silhouette(frame, body)).any():
                continue
            seen, pose = frame.sight.bodies == body.id, frame.poses[body.name]
            for folder, mask in (("mask", whole), ("mask_visib", seen)):
                file = place / folder / f"{name}_{len(poses):06d}.png"
                Image.fromarray(mask.astype(np.uint8) * 255).save(file)
            poses.append(
                {
                    "cam_R_m2c": rounded(pose[:3, :3].ravel(), 9),
                    "cam_t_m2c": rounded(_MM * pose[:3, 3]),
                    "obj_id": self._numbers[body.name],
                }
            )
            infos.append(
                {
                    "bbox_obj": _box(whole),
                    "bbox_visib": _box(seen),
                    "px_count_all": int(whole.sum()),
                    "px_count_valid": int((whole & frame.sight.hit).sum()),
                    "px_count_visib": int(seen.sum()),
                    "visib_fract": round(float(seen.sum() / whole.sum()), 6),
                }
            )
        return poses, infos

    def _model(self, body: Body, shape: Triangles) -> int:
        """Return the number of a model; a new one is written for a shape not seen before."""
        key = sha256(shape.vertices.tobytes() + shape.faces.tobytes()).hexdigest()
        if key not in self._models:
            number = self._models[key] = len(self._models) + 1
            vertices = _MM * shape.vertices
            _write_ply(self.directory / "models" / f"obj_{number:06d}.ply", vertices, shape.faces)
            low, size = vertices.min(axis=0), np.ptp(vertices, axis=0)
            self._infos[str(number)] = {
                "name": body.name,
                "diameter": round(_diameter(vertices), 6),
                **dict(zip(("min_x", "min_y", "min_z"), rounded(low), strict=True)),
                **dict(zip(("size_x", "size_y", "size_z"), rounded(size), strict=True)),
            }
        return self._models[key]

    def _place(self, number: int) -> Path:
        return self.directory / "train" / f"{self._scene + number:06d}"

    def _close_scenes(self) -> None:
        for number, scene in enumerate(self._scenes):
            for name, content in scene.items():
                file = self._place(number) / f"scene_{name}.json"
                file.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")

    def close(self) -> None:
        """Write what is known of the last scenes, the models and the camera."""
        self._close_scenes()
        (self.directory / "camera.json").write_text(json.dumps(self._camera, indent=2) + "\n", "utf-8")
        text = json.dumps(self._infos, indent=2) + "\n"
        (self.directory / "models" / "models_info.json").write_text(text, encoding="utf-8")


def _calibration(projection: Projection) -> dict[str, Any]:
    """Return the content of camera.json; the matrix of each frame is in scene_camera.json too."""
    (fx, _, cx), (_, fy, cy), _ = projection.intrinsics.tolist()
    width, height = projection.size
    size = {"width": width, "height": height, "depth_scale": _DEPTH_SCALE}
    return {"cx": cx, "cy": cy, "fx": fx, "fy": fy, **size}


def _camera(frame: TruthFrame) -> dict[str, Any]:
    view = frame.sight.view
    turn, position = view.pose[:3, :3], view.pose[:3, 3]
    return {
        "cam_K": rounded(view.projection.intrinsics.ravel()),
        "cam_R_w2c": rounded(turn.T.ravel(), 9),
        "cam_t_w2c": rounded(-_MM * turn.T @ position),
        "depth_scale": _DEPTH_SCALE,
    }


def _box(mask: NDArray[np.bool_]) -> list[int]:
    """Return left, top, width and height of a mask; -1 without pixels, as BOP has it."""
    if not mask.any():
        return [-1, -1, -1, -1]
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    left, top = int(columns[0]), int(rows[0])
    return [left, top, int(columns[-1]) - left + 1, int(rows[-1]) - top + 1]


def _diameter(vertices: NDArray[np.float64]) -> float:
    """Return the largest distance of two vertices."""
    points = np.unique(vertices, axis=0)
    return max(float(np.linalg.norm(points - point, axis=1).max()) for point in points)


def _vertex_normals(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return unit normals, shape (n, 3): of the faces around a vertex, weighted by their angles there."""
    corners = vertices[faces]
    ahead, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    across = np.cross(ahead, back)
    size = np.linalg.norm(across, axis=2)
    angles = np.arctan2(size, (ahead * back).sum(axis=2))
    sums = np.zeros_like(vertices)
    np.add.at(sums, faces, across * (angles / np.maximum(size, 1e-300))[..., None])
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.where(length > 0.0, sums / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])


def _write_ply(file: Path, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> None:
    properties = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    header = (
        f"ply\nformat ascii 1.0\nelement vertex {len(vertices)}\n{properties}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.hstack([vertices, _vertex_normals(vertices, faces)]).tolist()
    points = "".join(" ".join(f"{number:.6f}" for number in row) + "\n" for row in rows)
    triangles = "".join(f"3 {a} {b} {c}\n" for a, b, c in faces.tolist())
    file.write_text(header + points + triangles, encoding="ascii")
