"""What a stereo pair costs with endoscope looks, compared with plain looks.

python bench/pictures.py --json

The scene: an instrument over a lobe of liver in an abdomen, 320 x 288 pixels for each eye, the nodes
moved for every pair. Both looks draw the same states in one process in turns; `ratio` is the median of
the rounds' ratios of CPU time, all threads counted. `pairs_per_cpu_second` depends on the machine.
`first_picture_s` has all shaders to compile, unless the driver has kept them on disk. `update_ms` is the
part of a pair for vertices and tangent frames of the tissue, and their upload. `truth`: segmentation and
depth against ray casting, flow against moved points (`bench.picture_truth`).
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from bench.picture_truth import measure_truth
from engines.mujoco import model
from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.endoscope_scene import EndoscopeScene
from engines.mujoco.pictures.filament import backend
from engines.mujoco.pictures.filament.backend import Backend
from engines.mujoco.pictures.filament.renderer import FilamentRenderer
from engines.mujoco.pictures.soft_body import SoftBody
from engines.tissue.organs.params import OrganParams
from schemas.ros import Header
from schemas.trocar_msgs import SoftBodyState

ROUNDS, PAIRS_A_ROUND = 7, 6
ORGAN = {"shape": "liver-lobe", "nodes": 270, "orientation": [0, -0.5, 0, 0.8660254]}
SCENE: dict[str, Any] = {
    "arms": {
        "PSM1": {
            "instrument": "CADIERE_FORCEPS_400049",
            "position": ["181.6 mm", 0, "99 mm"],
            "orientation": [0, 0.5, 0, 0.8660254],
            "start": [0, 0, "150 mm", 0, 0, 0],
        },
        "ECM": {
            "position": ["120 mm", "-110 mm", "150 mm"],
            "orientation": [0.1326351, -0.371565, 0.8654006, -0.3089163],
            "start": [0, 0, "86 mm", 0],
        },
    },
    "skins": {"liver": {}},
}


class Drawn:
    """The scene with one of the looks."""

    def __init__(self, engine: Backend | str, looks: str) -> None:
        params = EndoscopeParams.model_validate(SCENE | {"looks": looks})
        mesh = OrganParams.model_validate(ORGAN).rest
        self.nodes, self.body = mesh.nodes, SoftBody("liver/nodes")
        self.accept(mesh.nodes, mesh.triangles.astype(np.uint32).ravel())
        start = time.perf_counter()
        self.scene = EndoscopeScene(params, engine, {"liver": self.body})
        self.positions = start_positions(params)
        self.scene.draw(self.positions)
        self.first_picture_s = time.perf_counter() - start
        self.count = 0

    def accept(self, nodes: Any, triangles: Any) -> None:
        self.body.accept(
            SoftBodyState(
                header=Header(frame_id="world"),
                body="liver",
                nodes_m=nodes.astype(np.float32).ravel(),
                triangles=triangles,
            )
        )

    def draw(self) -> None:
        self.count += 1
        self.accept(self.nodes + 1e-4 * np.sin(self.count), np.zeros(0, np.uint32))
        self.scene.draw(self.positions)

    def update(self) -> None:
        renderer = self.scene._renderer
        assert isinstance(renderer, FilamentRenderer)
        for body in renderer._bodies:
            body.update()


def start_positions(params: EndoscopeParams) -> NDArray[np.float64]:
    """Positions of all joints at the start, shape (nq,)."""
    built = model.build(params)
    data = mujoco.MjData(built)
    model.place(built, data, params.arms)
    return data.qpos.copy()


def cpu_time(call: Callable[[], None]) -> float:
    """Seconds of CPU time a call, over all threads of the process."""
    start = time.process_time()
    for _ in range(PAIRS_A_ROUND):
        call()
    return (time.process_time() - start) / PAIRS_A_ROUND


def measure(found: Backend, gl: str) -> dict[str, float]:
    endoscope, plain = Drawn(found, "endoscope"), Drawn(gl, "plain")
    first, second = [], []
    for _ in range(ROUNDS):
        first.append(cpu_time(endoscope.draw))
        second.append(cpu_time(plain.draw))
    update = cpu_time(endoscope.update)
    endoscope.scene.close()
    plain.scene.close()
    return {
        "first_picture_s": endoscope.first_picture_s,
        "pairs_per_cpu_second": 1.0 / statistics.median(first),
        "plain_pairs_per_cpu_second": 1.0 / statistics.median(second),
        "ratio": statistics.median(a / b for a, b in zip(first, second, strict=True)),
        "update_ms": 1e3 * update,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    wants_json = parser.parse_args().json
    found, gl = backend.find(), opengl.find()
    if not found.name or not gl.name:
        sys.exit(f"Filament: {found.name or found.detail}; OpenGL: {gl.detail}. To fix it: {backend.REMEDY}")
    result = {"filament": f"{found.name}, {found.detail}"} | measure(found, gl.name)
    if wants_json:
        print(json.dumps(result | {"truth": measure_truth(gl.name)}, indent=2))
        return
    for name, value in result.items():
        print(f"{name}: {value if isinstance(value, str) else round(value, 2)}")


if __name__ == "__main__":
    main()
