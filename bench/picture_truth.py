"""Truth beside pictures against ray casting by MuJoCo's physics, and flow against moved points.

python bench/picture_truth.py --json

Two scenes of 320 x 288 pixels: an instrument over a lobe of liver, and objects on a table. Rays go
through the middles of all pixels: `mj_ray` for the robot and the objects, `mju_raySkin` for the liver.
`segmentation_equal` is the share of pixels in which both show the same body, `inside` that of pixels
whose eight neighbours show the same body. `depth_*` are of 1000 random pixels in which both do. For
`flow_px_*` instrument, objects and endoscope move, and the liver is sheared; the points that the rays
have met are moved as bodies and shear say, and projected. `look_ms` is CPU time for both eyes.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from typing import Any

import mujoco
import numpy as np

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.truth.sight import Sight, Viewpoint
from engines.mujoco.truth.truth_scene import Instant, TruthScene
from schemas.vectors import Vector
from tests.engines.mujoco.truth.rays import cast_geoms
from tests.engines.mujoco.truth.scenes import OBJECTS, TISSUE, Tissue, start_positions

SIZE = {"width": 320, "height": 288}
SHEAR = np.array([[1.0, 0.05, 0.0], [0.0, 1.0, 0.03], [0.02, 0.0, 1.0]])
SHIFT = np.array([1e-3, -2e-3, 1e-3])
MOVES = {"PSM1/yaw": 0.03, "PSM1/roll": 0.2, "PSM1/insertion": 2e-3, "ECM/roll": 0.02, "ECM/insertion": 2e-3}
RANDOM_PIXELS, ROUNDS = 1000, 5


def cast_soft(view: Viewpoint, corners: Vector) -> Vector:
    """Depth of triangles, shape (f, 3, 3), in the optical frame, in each pixel; inf: nothing."""
    faces = np.arange(3 * len(corners), dtype=np.int32).reshape(1, -1)
    points = np.ascontiguousarray(corners.reshape(1, -1), np.float32)
    found = np.full(view.size[0] * view.size[1], np.inf)
    for i, ray in enumerate(view.projection.rays.reshape(-1, 3)):
        length = np.linalg.norm(ray)
        distance = mujoco.mju_raySkin(
            faces.size // 3, points.size // 3, faces, points, np.zeros(3), ray / length, None
        )
        if distance >= 0.0:
            found[i] = distance / length
    return found


class Case:
    """One scene, looked at twice."""

    def __init__(self, gl: str, scene: dict[str, Any], *, soft: bool) -> None:
        self.params = EndoscopeParams.model_validate(scene | SIZE)
        self.tissue = Tissue() if soft else None
        self.scene = TruthScene(self.params, gl, {} if self.tissue is None else {"liver": self.tissue.body})
        self.positions = start_positions(self.params)

    def cast(self, instant: Instant, sight: Sight) -> tuple[Vector, Vector]:
        """Number of the body and depth by rays, shape (height, width)."""
        cast = cast_geoms(
            self.scene.model, self.scene.data, sight.view, sight.view.projection.rays.reshape(-1, 3)
        )
        names = {body.name: body.id for body in self.scene.bodies}
        body = np.array([names[self.scene.model.body(i).name] if i >= 0 else 0 for i in cast.body])
        depth = cast.depth
        if self.tissue is not None:
            own = instant.surfaces.bodies == names["liver"]
            soft = cast_soft(sight.view, sight.view.to_camera(instant.vertices)[instant.surfaces.faces[own]])
            body, depth = np.where(soft < depth, names["liver"], body), np.minimum(soft, depth)
        return body.reshape(sight.hit.shape), depth.reshape(sight.hit.shape)

    def measure(self) -> dict[str, float]:
        scene, data = self.scene, self.scene.data
        before = scene.look(self.positions)
        sight = before.sights["left"]
        body, depth = self.cast(before, sight)
        same = body == sight.bodies
        grown = np.pad(sight.bodies, 1, mode="edge")
        height, width = same.shape
        inside = np.all(
            [grown[y : y + height, x : x + width] == sight.bodies for y in range(3) for x in range(3)], axis=0
        )
        chosen = np.random.default_rng(0).choice(np.flatnonzero(same & sight.hit), RANDOM_PIXELS)
        error = np.abs(depth - sight.depth).ravel()[chosen]
        places = data.xpos.copy(), data.xmat.reshape(-1, 3, 3).copy()
        moved = self.positions.copy()
        for joint, by in MOVES.items():
            if joint.split("/")[0] in self.params.arms:
                moved[scene.model.joint(joint).qposadr[0]] += by
        for name in self.params.objects:
            start = int(scene.model.joint(name).qposadr[0])
            moved[start : start + 3] += SHIFT
        if self.tissue is not None:
            self.tissue.move(self.tissue.nodes @ SHEAR.T + SHIFT)
        now = scene.look(moved)
        flow = scene.motion(before, "left", now).flow
        picked = same & sight.hit & inside
        rays = sight.view.projection.rays[picked] * depth[picked][:, None]
        points = sight.view.pose[:3, 3] + rays @ sight.view.pose[:3, :3].T
        after = points @ SHEAR.T + SHIFT
        for one in scene.bodies[: scene.rigid_count]:
            i, own = scene.model.body(one.name).id, body[picked] == one.id
            after[own] = (
                data.xpos[i] + ((points[own] - places[0][i]) @ places[1][i]) @ data.xmat[i].reshape(3, 3).T
            )
        view = now.sights["left"].view
        rows, columns = np.nonzero(picked)
        expected = view.projection.project(view.to_camera(after)) - np.stack([columns, rows], axis=1)
        miss = np.linalg.norm(flow[picked] - expected, axis=1)
        start = time.process_time()
        for _ in range(ROUNDS):
            scene.look(moved)
        return {
            "segmentation_equal": float(same.mean()),
            "segmentation_equal_of_shown": float(same[sight.hit].mean()),
            "segmentation_equal_inside": float(same[inside].mean()),
            "depth_mm_median": 1e3 * float(np.median(error)),
            "depth_mm_most": 1e3 * float(error.max()),
            "flow_px_length_median": float(np.median(np.linalg.norm(expected, axis=1))),
            "flow_px_median": float(np.median(miss)),
            "flow_px_99": float(np.quantile(miss, 0.99)),
            "look_ms": 1e3 * (time.process_time() - start) / ROUNDS,
        }


def measure_truth(gl: str) -> dict[str, dict[str, float]]:
    """Figures by scene."""
    cases = {"tissue": Case(gl, TISSUE, soft=True), "objects": Case(gl, OBJECTS, soft=False)}
    found = {name: case.measure() for name, case in cases.items()}
    for case in cases.values():
        case.scene.close()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    wants_json = parser.parse_args().json
    gl = opengl.find()
    if not gl.name:
        sys.exit(f"OpenGL: {gl.detail}. To fix it: {opengl.REMEDY}")
    result = measure_truth(gl.name)
    if wants_json:
        print(json.dumps(result, indent=2))
        return
    for scene, figures in result.items():
        for name, value in figures.items():
            print(f"{scene} {name}: {value:.6g}")


if __name__ == "__main__":
    main()
