"""Scenes for the tests of truth: an instrument over tissue, and objects on a table."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from engines.mujoco import model
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.soft_body import SoftBody
from engines.tissue.organs.params import OrganParams
from schemas.ros import Header
from schemas.trocar_msgs import SoftBodyState
from schemas.vectors import Vector

TISSUE: dict[str, Any] = {
    "arms": {
        "PSM1": {
            "instrument": "CADIERE_FORCEPS_400049",
            "position": ["181.6 mm", 0, "99 mm"],
            "orientation": [0, 0.5, 0, 0.8660254],
            "start": [0, 0, "170 mm", 0, 0, 0],
        },
        "ECM": {
            "position": ["120 mm", "-110 mm", "150 mm"],
            "orientation": [0.1326351, -0.371565, 0.8654006, -0.3089163],
            "start": [0, 0, "86 mm", 0],
        },
    },
    "skins": {"liver": {}},
    "width": 160,
    "height": 144,
}
OBJECTS: dict[str, Any] = {
    "arms": {"PSM1": {"instrument": "LARGE_NEEDLE_DRIVER_400006", "position": [0.0, 0.0, 0.12]}},
    "table": {"position": [0, 0, "-5 mm"], "size": ["120 mm", "100 mm", "10 mm"]},
    "objects": {
        "needle": {"kind": "needle", "position": ["20 mm", "10 mm", 0]},
        "ring": {"kind": "ring", "position": ["-20 mm", "-10 mm", "1 mm"]},
        "block": {"kind": "block", "size": ["8 mm"] * 3, "position": ["5 mm", "-20 mm", "4 mm"]},
    },
    "view": {"position": [0.05, -0.12, 0.09], "target": [0.0, 0.0, 0.0]},
    "baseline": 0.0,
    "width": 160,
    "height": 120,
}


def start_positions(params: EndoscopeParams) -> Vector:
    """Positions of all joints at the start, shape (nq,)."""
    built = model.build(params)
    data = mujoco.MjData(built)
    model.place(built, data, params.arms)
    return data.qpos.copy()


class Tissue:
    """A lobe of liver, moved by hand."""

    def __init__(self) -> None:
        shape = {"shape": "liver-lobe", "nodes": 270, "orientation": [0, -0.5, 0, 0.8660254]}
        mesh = OrganParams.model_validate(shape).rest
        self.nodes, self.body = mesh.nodes, SoftBody("liver/nodes")
        self.move(mesh.nodes, mesh.triangles.astype(np.uint32).ravel())

    def move(self, nodes: Vector, triangles: NDArray[np.uint32] | None = None) -> None:
        self.body.accept(
            SoftBodyState(
                header=Header(frame_id="world"),
                body="liver",
                nodes_m=nodes.astype(np.float32).ravel(),
                triangles=np.zeros(0, np.uint32) if triangles is None else triangles,
            )
        )
