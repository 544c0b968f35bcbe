"""Rules of annotated data sets, as their authors state them, and what breaks them.

COCO: https://cocodataset.org/#format-data; run lengths as pycocotools reads them. BOP:
https://github.com/thodan/bop_toolkit/blob/master/docs/bop_datasets_format.md.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

COCO_FIELDS: dict[str, dict[str, type | tuple[type, ...]]] = {
    "images": {"id": int, "width": int, "height": int, "file_name": str},
    "annotations": {
        "id": int,
        "image_id": int,
        "category_id": int,
        "segmentation": dict,
        "area": (int, float),
        "bbox": list,
        "iscrowd": int,
    },
    "categories": {"id": int, "name": str, "supercategory": str},
}
BOP_FIELDS: dict[str, dict[str, int]] = {
    "camera": {"cam_K": 9, "depth_scale": 1, "cam_R_w2c": 9, "cam_t_w2c": 3},
    "gt": {"obj_id": 1, "cam_R_m2c": 9, "cam_t_m2c": 3},
    "gt_info": {
        "bbox_obj": 4,
        "bbox_visib": 4,
        "px_count_all": 1,
        "px_count_valid": 1,
        "px_count_visib": 1,
        "visib_fract": 1,
    },
}
"""How many numbers each field has."""


def read_json(file: Path) -> Any:
    return json.loads(file.read_text())


def decode_mask(segmentation: dict[str, Any]) -> NDArray[np.bool_]:
    """Return the mask of uncompressed run lengths: columns one after the other, empty pixels first."""
    height, width = segmentation["size"]
    values = np.arange(len(segmentation["counts"])) % 2 == 1
    return values.repeat(segmentation["counts"]).reshape(width, height).T


def box_of(mask: NDArray[np.bool_]) -> list[int]:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not rows.size:
        return [-1, -1, -1, -1]
    size = columns[-1] - columns[0] + 1, rows[-1] - rows[0] + 1
    return [int(n) for n in (columns[0], rows[0], *size)]


def coco_problems(directory: Path) -> Iterator[str]:
    """Yield what breaks the rules of COCO's object and keypoint annotations."""
    content = read_json(directory / "annotations.json")
    yield from (f"no {name}" for name in ("info", "licenses", *COCO_FIELDS) if name not in content)
    for name, fields in COCO_FIELDS.items():
        ids = [one["id"] for one in content[name]]
        if len(set(ids)) < len(ids):
            yield f"ids of {name} are not unique"
        for one in content[name]:
            for field, type_ in fields.items():
                if not isinstance(one.get(field), type_) or isinstance(one[field], bool):
                    yield f"{name} {one['id']}: {field}"
    images = {one["id"]: one for one in content["images"]}
    categories = {one["id"]: one for one in content["categories"]}
    for one in content["images"]:
        with Image.open(directory / one["file_name"]) as picture:
            if picture.size != (one["width"], one["height"]):
                yield f"images {one['id']}: another size than its file"
    for one in content["categories"]:
        count = len(one.get("keypoints", []))
        if any(not 1 <= end <= count for link in one.get("skeleton", []) for end in link):
            yield f"categories {one['id']}: a skeleton that leaves its keypoints"
    for one in content["annotations"]:
        yield from _coco_annotation(one, images[one["image_id"]], categories[one["category_id"]])


def _coco_annotation(one: dict[str, Any], image: dict[str, Any], category: dict[str, Any]) -> Iterator[str]:
    where, size = f"annotations {one['id']}", [image["height"], image["width"]]
    if one["segmentation"]["size"] != size or sum(one["segmentation"]["counts"]) != size[0] * size[1]:
        yield f"{where}: run lengths of another size than the picture"
        return
    mask = decode_mask(one["segmentation"])
    if one["area"] != mask.sum() or one["area"] == 0:
        yield f"{where}: area"
    if one["bbox"] != box_of(mask):
        yield f"{where}: bbox"
    if ("keypoints" in one) != ("keypoints" in category):
        yield f"{where}: keypoints of annotation and category"
    if "keypoints" not in one:
        return
    points = np.array(one["keypoints"]).reshape(-1, 3)
    if len(points) != len(category["keypoints"]) or one["num_keypoints"] != (points[:, 2] > 0).sum():
        yield f"{where}: number of keypoints"
    if not np.isin(points[:, 2], (0, 1, 2)).all() or points[points[:, 2] == 0].any():
        yield f"{where}: visibility of keypoints"
    inside = (points[:, :2] >= -0.5) & (points[:, :2] <= np.array(size[::-1]) - 0.5)
    if not inside[points[:, 2] > 0].all():
        yield f"{where}: a keypoint outside the picture"


def read_ply(file: Path) -> NDArray[np.float64]:
    """Return the vertices of an ASCII PLY with their properties, shape (n, properties)."""
    lines = file.read_text().splitlines()
    count = int(next(line for line in lines if line.startswith("element vertex")).split()[-1])
    start = lines.index("end_header") + 1
    return np.array([line.split() for line in lines[start : start + count]], float)


def bop_problems(directory: Path) -> Iterator[str]:
    """Yield what breaks the rules of BOP's layout."""
    camera = read_json(directory / "camera.json")
    yield from (
        f"camera.json: {f}"
        for f in ("fx", "fy", "cx", "cy", "width", "height", "depth_scale")
        if f not in camera
    )
    infos = read_json(directory / "models" / "models_info.json")
    for key, info in infos.items():
        vertices = read_ply(directory / "models" / f"obj_{int(key):06d}.ply")
        if vertices.shape[1] < 6 or not np.allclose(np.linalg.norm(vertices[:, 3:6], axis=1), 1.0, atol=1e-3):
            yield f"model {key}: no normals"
        low, size = vertices[:, :3].min(axis=0), np.ptp(vertices[:, :3], axis=0)
        stated = [[info[f"{of}_{axis}"] for axis in "xyz"] for of in ("min", "size")]
        if not np.allclose(stated, [low, size], atol=1e-4) or info["diameter"] < size.max() - 1e-4:
            yield f"model {key}: bounds"
    for scene in sorted((directory / "train").iterdir()):
        yield from (f"{scene.name}: {problem}" for problem in _bop_scene(scene, set(infos)))


def _bop_scene(scene: Path, models: set[str]) -> Iterator[str]:
    contents = {name: read_json(scene / f"scene_{name}.json") for name in BOP_FIELDS}
    names = [file.stem for file in sorted((scene / "rgb").iterdir())]
    if any([f"{int(key):06d}" for key in content] != names for content in contents.values()):
        yield "pictures and descriptions differ"
    for key in contents["camera"]:
        rows = {name: content[key] for name, content in contents.items()}
        rows["camera"] = [rows["camera"]]
        for name, fields in BOP_FIELDS.items():
            for one in rows[name]:
                yield from (
                    f"{name} {key}: {field}"
                    for field, n in fields.items()
                    if np.size(one.get(field, [])) != n
                )
        with Image.open(scene / "depth" / f"{int(key):06d}.png") as file:
            depth = np.asarray(file)
        if depth.dtype != np.uint16:
            yield f"depth {key}: {depth.dtype}"
        if len(rows["gt"]) != len(rows["gt_info"]):
            yield f"{key}: poses without info"
        for number, (pose, info) in enumerate(zip(rows["gt"], rows["gt_info"], strict=True)):
            yield from _bop_pose(scene, f"{int(key):06d}_{number:06d}", depth, pose, info)
            if str(pose["obj_id"]) not in models:
                yield f"gt {key}: no model {pose['obj_id']}"


def _bop_pose(
    scene: Path, name: str, depth: NDArray[np.uint16], pose: dict[str, Any], info: dict[str, Any]
) -> Iterator[str]:
    whole, seen = (
        np.asarray(Image.open(scene / folder / f"{name}.png")) for folder in ("mask", "mask_visib")
    )
    if not {*np.unique(whole), *np.unique(seen)} <= {0, 255}:
        yield f"mask {name}: values"
    whole, seen = whole > 0, seen > 0
    turn = np.array(pose["cam_R_m2c"]).reshape(3, 3)
    if not np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) or np.linalg.det(turn) < 0.0:
        yield f"gt {name}: no rotation"
    if (seen & ~whole).any():
        yield f"mask {name}: seen outside the silhouette"
    counts = int(whole.sum()), int((whole & (depth > 0)).sum()), int(seen.sum())
    if counts != tuple(info[f"px_count_{of}"] for of in ("all", "valid", "visib")):
        yield f"gt_info {name}: pixels"
    if abs(info["visib_fract"] - counts[2] / counts[0]) > 1e-5:
        yield f"gt_info {name}: visib_fract"
    if (info["bbox_obj"], info["bbox_visib"]) != (box_of(whole), box_of(seen)):
        yield f"gt_info {name}: boxes"
