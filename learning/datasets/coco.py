"""COCO's layout: masks, boxes and keypoints of every instance, https://cocodataset.org/#format-data.

DIR/images/000000_left.png        and right
DIR/annotations.json              images, annotations, categories; masks as uncompressed run lengths
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from engines.mujoco.truth.files import camera_json, instance_picture
from engines.mujoco.truth.keypoints import InstrumentView
from engines.mujoco.truth.labels import Body
from engines.mujoco.truth.recorded_truth import RecordedTruth, TruthFrame
from engines.mujoco.truth.scene_class import INSTRUMENT_CLASSES, SceneClass
from learning.datasets.annotations import Annotations, rounded
from learning.datasets.truth import Stereo

__all__ = ["Coco", "run_lengths"]

_FIRST_INSTRUMENT = 1000
"""Number of the first category of instruments; those of other categories are of `SceneClass`."""
_LEFT_OUT = (SceneClass.SURROUNDINGS, SceneClass.TABLE)
_SUPERCATEGORIES = {SceneClass.ARM: "robot", SceneClass.FIXTURE: "object", SceneClass.OBJECT: "object"}


class Coco(Annotations):
    """Annotations in COCO's layout."""

    def __init__(self, directory: Path) -> None:
        super().__init__(directory)
        (directory / "images").mkdir(parents=True)
        self._images: list[dict[str, Any]] = []
        self._annotations: list[dict[str, Any]] = []
        self._categories: dict[str, dict[str, Any]] = {}
        self._source: Mapping[str, Any] = {}

    def begin(self, truth: RecordedTruth, source: Mapping[str, Any]) -> None:  # noqa: ARG002
        """Remember where the next pictures are from."""
        self._source = source

    def add(self, truth: RecordedTruth, stereo: Stereo) -> None:
        """Append a picture for each eye, and an annotation for each instance in it."""
        for eye, frame in stereo.truth.items():
            number = len(self._images)
            name = f"images/{number // 2:06d}_{eye}.png"
            Image.fromarray(stereo.pictures[eye]).save(self.directory / name)
            camera = camera_json(frame.sight.view)
            self._images.append(
                {"id": number, "file_name": name, "width": camera["width"], "height": camera["height"]}
                | {"time_s": frame.time_ns * 1e-9, "camera": camera, **self._source}
            )
            self._annotate(number, frame, truth.bodies)

    def _annotate(self, image: int, frame: TruthFrame, bodies: tuple[Body, ...]) -> None:
        instances = instance_picture(frame.sight.bodies, bodies)
        first = {body.instance: body for body in reversed(bodies)}
        for number in np.unique(instances[instances > 0]).tolist():
            body = first[number]
            if body.scene_class in _LEFT_OUT:
                continue
            mask = instances == number
            rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
            left, top = int(columns[0]), int(rows[0])
            is_instrument = body.scene_class in INSTRUMENT_CLASSES
            view = frame.instruments.get(body.instance_name) if is_instrument else None
            self._annotations.append(
                {
                    "id": len(self._annotations) + 1,
                    "image_id": image,
                    "category_id": self._category(body, view),
                    "instance": body.instance_name,
                    "segmentation": {"size": list(mask.shape), "counts": run_lengths(mask)},
                    "area": int(mask.sum()),
                    "bbox": [left, top, int(columns[-1]) - left + 1, int(rows[-1]) - top + 1],
                    "iscrowd": 0,
                }
                | ({} if view is None else _keypoints(view))
            )

    def _category(self, body: Body, view: InstrumentView | None) -> int:
        """Return the number of a category, a new one for an instrument seen for the first time."""
        name = body.scene_class.name.lower() if view is None else view.tool
        if name not in self._categories:
            number, more = int(body.scene_class), dict[str, Any]()
            above = _SUPERCATEGORIES.get(body.scene_class)
            if view is not None:
                number = _FIRST_INSTRUMENT + sum(
                    one["supercategory"] == "instrument" for one in self._categories.values()
                )
                names = list(view.keypoints)
                more = {"keypoints": names, "skeleton": _skeleton(names)}
                above = "instrument"
            elif above is None:
                above = "tissue" if body.scene_class >= SceneClass.TISSUE else "object"
            self._categories[name] = {"id": number, "name": name, "supercategory": above, **more}
        return self._categories[name]["id"]

    def close(self) -> None:
        """Write annotations.json."""
        content = {
            "info": {"description": "Trocar; pixel (0, 0) is the middle of the upper left pixel"},
            "licenses": [],
            "images": self._images,
            "annotations": self._annotations,
            "categories": sorted(self._categories.values(), key=lambda one: one["id"]),
        }
        (self.directory / "annotations.json").write_text(json.dumps(content) + "\n", encoding="utf-8")


def run_lengths(mask: NDArray[np.bool_]) -> list[int]:
    """Return lengths of runs of a mask, shape (height, width), column by column, empty pixels first."""
    flat = mask.ravel(order="F")
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    lengths = np.diff(np.concatenate([[0], changes, [flat.size]])).tolist()
    return [0, *lengths] if flat[0] else lengths


def _skeleton(names: list[str]) -> list[list[int]]:
    """Return pairs of keypoints, counted from 1: along the shaft and the wrist, and to each finger."""
    numbers = {name: number for number, name in enumerate(names, 1)}
    ends = [name for name in names if name.endswith("_end") and name != "shaft_end"]
    chain = [name for name in names if name not in ends and name != "tip"] or ["tip"]
    links = [[numbers[one], numbers[other]] for one, other in pairwise(chain)]
    return links + [[numbers[chain[-1]], numbers[name]] for name in ends or ["tip"]]


def _keypoints(view: InstrumentView) -> dict[str, Any]:
    points = [
        [*rounded(point.pixel, 3), point.visibility] if point.visibility else [0, 0, 0]
        for point in view.keypoints.values()
    ]
    return {
        "keypoints": [number for point in points for number in point],
        "num_keypoints": sum(point[2] > 0 for point in points),
        "camera_from_tip": rounded(view.tip_pose, 9),
    }
