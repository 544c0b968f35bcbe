"""What a soft body in the picture costs: its surface, MuJoCo's scene, and the drawing.

python bench/skin_cost.py --json

For three ways in which MuJoCo can show one. A dented block of 80 x 60 x 20 mm of about 250, 1000 and 5000
nodes fills a picture of 320 x 288 pixels, shadows off. `surface_ms`: the displayed vertices from the nodes.
`update_ms`: new vertices into MuJoCo's scene, by a skin whose vertices in the model are replaced (what Trocar
does), a flex whose vertices in the data are replaced, and a mesh that is uploaded again, all of the body's
own triangles. `pair_ms`: a stereo pair of the endoscope with the displayed surface in it, `empty_pair_ms`:
without. CPU time of all threads, medians; compare rows of one run.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.endoscope_scene import EndoscopeScene
from engines.mujoco.pictures.skin_mesh import SkinMesh
from engines.mujoco.pictures.soft_body import SoftBody
from engines.tissue.meshing.grid import block
from engines.tissue.meshing.tet_mesh import TetMesh
from schemas.ros import Header
from schemas.trocar_msgs import SoftBodyState
from schemas.vectors import Vector

NODES = (250, 1000, 5000)
ROUNDS, PER_ROUND = 7, 10
SIZE = np.array([0.08, 0.06, 0.02])
VIEW = {"position": [0.06, -0.07, 0.05], "target": [0.0, 0.0, -0.005]}


def cost(do: Callable[[], object]) -> float:
    """Milliseconds of CPU time, the median of several rounds."""
    do()
    rounds: list[float] = []
    for _ in range(ROUNDS):
        start = time.process_time()
        for _ in range(PER_ROUND):
            do()
        rounds.append((time.process_time() - start) / PER_ROUND * 1e3)
    return statistics.median(rounds)


def dented(mesh: TetMesh) -> Vector:
    """The nodes with 5 mm of dent in the top."""
    nodes = mesh.nodes.copy()
    nodes[:, 2] -= 5e-3 * np.exp(-(nodes[:, :2] ** 2).sum(axis=1) / 0.015**2) * (nodes[:, 2] > -1e-6)
    return nodes


def updates(mesh: TetMesh, nodes: Vector) -> dict[str, float]:
    """Milliseconds to bring `nodes` into a scene, by each of MuJoCo's means."""
    vertices, faces = mesh.nodes.ravel(), mesh.triangles.ravel()
    bones = {
        "bodyname": ["world"],
        "bindpos": [0, 0, 0],
        "bindquat": [1, 0, 0, 0],
        "vertid": [[*range(len(nodes))]],
        "vertweight": [[1.0] * len(nodes)],
    }
    found: dict[str, float] = {}
    for means in ("skin", "flex", "mesh"):
        spec = mujoco.MjSpec()
        if means == "skin":
            spec.add_skin(name="body", vert=vertices, face=faces, **bones)
        elif means == "flex":
            spec.add_flex(name="body", dim=2, vert=vertices, elem=faces, vertbody=["world"], radius=1e-5)
        else:
            spec.add_mesh(name="body", uservert=vertices, userface=faces)
            spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="body")
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        renderer = mujoco.Renderer(model, 16, 16)

        def update(
            model: Any = model, data: Any = data, renderer: Any = renderer, means: str = means
        ) -> None:
            if means == "skin":
                model.skin_vert[:] = nodes
            elif means == "flex":
                data.flexvert_xpos[:] = nodes
            else:
                model.mesh_vert[:] = nodes
                mujoco.mjr_uploadMesh(model, renderer._mjr_context, 0)
            renderer.update_scene(data)

        found[means] = cost(update)
        renderer.close()
    return found


def pair(mesh: TetMesh | None, gl: str) -> float:
    """Milliseconds of a stereo pair of a small robot scene, with the body or without."""
    bodies: dict[str, SoftBody] = {}
    if mesh is not None:
        bodies["body"] = body = SoftBody("body/nodes")
        faces = mesh.triangles.astype(np.uint32).ravel()
        body.accept(
            SoftBodyState(
                header=Header(), body="body", nodes_m=mesh.nodes.astype(np.float32).ravel(), triangles=faces
            )
        )
        body.nodes = dented(mesh).astype(np.float32)
    scene = {
        "arms": {"PSM1": {"position": [0.0, 0.0, 0.12]}},
        "view": VIEW,
        "skins": {name: {} for name in bodies},
    }
    drawn = EndoscopeScene(EndoscopeParams.model_validate(scene), gl, bodies)
    positions = drawn._model.qpos0
    try:
        return cost(lambda: drawn.draw(positions))
    finally:
        drawn.close()


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
    rows: list[dict[str, Any]] = []
    for count in NODES:
        mesh = block(SIZE, count)
        skin, nodes = SkinMesh(mesh.nodes, mesh.triangles), dented(mesh)
        row = {"nodes": len(mesh.nodes), "triangles": len(mesh.triangles), "drawn_triangles": len(skin.faces)}
        row |= {
            "surface_ms": cost(lambda skin=skin, nodes=nodes: skin.vertices(nodes)),
            "update_ms": updates(mesh, nodes),
            "pair_ms": pair(mesh, found.name),
        }
        rows.append(row)
    result = {
        "opengl": f"{found.name}, {found.detail}",
        "empty_pair_ms": pair(None, found.name),
        "bodies": rows,
    }
    if wants_json:
        print(json.dumps(result, indent=2))
        return
    print(f"{result['opengl']}; a pair without soft body {result['empty_pair_ms']:.1f} ms")
    for row in rows:
        update = ", ".join(f"{means} {ms:.2f}" for means, ms in row["update_ms"].items())
        print(f"{row['nodes']} nodes, {row['drawn_triangles']} triangles drawn: ", end="")
        print(f"surface {row['surface_ms']:.2f} ms, update {update} ms, pair {row['pair_ms']:.1f} ms")


if __name__ == "__main__":
    main()
