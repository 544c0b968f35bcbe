"""What a stereo pair of the whole cart costs, compared with two pictures by MuJoCo's own renderer.

python bench/endoscope.py --json

The scene: patient cart, three instruments, endoscope and six objects; 320 x 288 pixels each, shadows off.
Once from the tip of the endoscope, once with everything in the picture, the most expensive view. Both
renderers draw the same state in the same process in turns; `ratio` is the median of the rounds' ratios of CPU
time, all threads counted. `pairs_per_cpu_second` depends on the machine.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from collections.abc import Sequence
from copy import copy
from typing import Any

import mujoco

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.endoscope_scene import EndoscopeScene

ROUNDS, PAIRS_A_ROUND = 15, 20
ARMS: dict[str, Any] = {
    arm: {"instrument": "LARGE_NEEDLE_DRIVER_400006"} for arm in ("PSM1", "PSM2", "PSM3")
} | {"ECM": {"start": [0, 0, "0.12 m", 0]}}
BLOCKS = {f"block{i}": {"kind": "block", "position": [0.05 * i, 0.9, 0.75]} for i in range(6)}
SCENE = {"arms": ARMS, "mounting": "cart", "objects": BLOCKS}
VIEWS: dict[str, dict[str, Any]] = {
    "endoscope": {},
    "overview": {"view": {"position": [2.2, 2.6, 1.9], "target": [0.0, 0.6, 0.9]}},
}


class Twice:
    """The same two pictures by `mujoco.Renderer`, one after the other."""

    def __init__(
        self, model: mujoco.MjModel, params: EndoscopeParams, eyes: Sequence[mujoco.MjvGLCamera]
    ) -> None:
        self.eyes, self.model = eyes, model
        self.data = mujoco.MjData(model)
        self.renderer = mujoco.Renderer(model, params.height, params.width)

    def draw(self) -> None:
        mujoco.mj_forward(self.model, self.data)
        for eye in self.eyes:
            self.renderer.update_scene(self.data)
            for name in (
                "pos",
                "forward",
                "up",
                "frustum_center",
                "frustum_bottom",
                "frustum_top",
                "frustum_near",
                "frustum_far",
            ):
                setattr(self.renderer.scene.camera[0], name, getattr(eye, name))
                setattr(self.renderer.scene.camera[1], name, getattr(eye, name))
            for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION):
                self.renderer.scene.flags[flag] = False
            self.renderer.render()


def cpu_time(draw: Any) -> float:
    """Seconds of CPU time a pair, over all threads of the process."""
    start = time.process_time()
    for _ in range(PAIRS_A_ROUND):
        draw()
    return (time.process_time() - start) / PAIRS_A_ROUND


def measure(view: dict[str, Any], gl: str) -> dict[str, float]:
    params = EndoscopeParams.model_validate(SCENE | view)
    scene = EndoscopeScene(params, gl)
    positions = scene._model.qpos0
    scene.draw(positions)
    # a model of its own: our renderer notes in its model what is in sight
    twice = Twice(copy(scene._model), params, scene._renderer._scene.camera)
    ours, theirs = [], []
    for _ in range(ROUNDS):
        ours.append(cpu_time(lambda: scene.draw(positions)))
        theirs.append(cpu_time(twice.draw))
    scene.close()
    twice.renderer.close()
    seen = (twice.model.geom_dataid >= 0) & (twice.model.geom_group < 3)  # MuJoCo shows groups 0 to 2
    triangles = int(twice.model.mesh_facenum[twice.model.geom_dataid[seen]].sum())
    ratio = statistics.median(a / b for a, b in zip(ours, theirs, strict=True))
    return {"triangles": triangles, "pairs_per_cpu_second": 1.0 / statistics.median(ours), "ratio": ratio}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    wants_json = parser.parse_args().json
    found = opengl.find()
    if not found.name:
        sys.exit(f"no OpenGL works here ({found.detail}); to fix it: {opengl.REMEDY}")
    # mujoco.Renderer has asked for it already, when mujoco was imported
    if os.environ.get("MUJOCO_GL") != found.name:
        os.execve(sys.executable, [sys.executable, *sys.argv], os.environ | {"MUJOCO_GL": found.name})
    result = {"opengl": f"{found.name}, {found.detail}"} | {
        name: measure(view, found.name) for name, view in VIEWS.items()
    }
    if wants_json:
        print(json.dumps(result, indent=2))
        return
    print(result["opengl"])
    for name in VIEWS:
        row = result[name]
        scene = f"{name}: {row['triangles']} triangles"
        print(
            f"{scene}, {row['pairs_per_cpu_second']:.0f} pairs per CPU second, {row['ratio']:.2f} of the time"
            " of two pictures by mujoco.Renderer"
        )


if __name__ == "__main__":
    main()
