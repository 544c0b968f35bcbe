"""Which place a scene has, and around what."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from engines.mujoco.model import build
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.pictures.surroundings import make_place
from tests.engines.mujoco.pictures.test_changed_skin import nodes_of
from tests.engines.tissue.cut_block import CutBlock

ARMS: dict[str, Any] = {"arms": {"PSM1": {"position": [0.0, 0.0, 0.3]}}, "looks": False}
BOARD = {"board": {"kind": "board", "board": "icra2026", "position": [0.1, 0.2, 0.3]}}
LENS = np.array([0.0, -0.08, 0.1])


@pytest.mark.parametrize(
    ("scene", "place"),
    [
        ({}, "none"),
        ({"skins": {"liver": {}}}, "abdomen"),
        ({"fixtures": BOARD, "skins": {"liver": {}}}, "dry-lab"),
        ({"fixtures": BOARD, "place": "none"}, "none"),
        ({"place": "abdomen"}, "abdomen"),
    ],
)
def test_a_scene_chooses_its_place(scene: dict[str, Any], place: str) -> None:
    assert EndoscopeParams.model_validate(ARMS | scene).surroundings == place


def test_a_board_lies_on_the_drape() -> None:
    params = EndoscopeParams.model_validate(ARMS | {"fixtures": BOARD})
    table, _ = make_place(params, build(params), {}, LENS)
    size = np.array(params.fixtures["board"].measures.size)  # type: ignore[union-attr]
    near = np.linalg.norm(table.vertices[:, :2] - [0.1, 0.2], axis=1) < 0.03
    assert near.any()
    assert table.vertices[near, 2].mean() == pytest.approx(0.3 - size[2], abs=5e-3)


def test_an_organ_has_an_abdomen_and_nothing_has_no_place() -> None:
    block, body = CutBlock(np.array([0.08, 0.06, 0.02]), 250), SoftBody("liver/nodes")
    body.accept(nodes_of(block.mesh.nodes, block.mesh.triangles))
    params = EndoscopeParams.model_validate(ARMS | {"skins": {"liver": {}}})
    bed, wall, *_ = make_place(params, build(params), {"liver": body}, LENS)
    assert bed.vertices[:, 2].min() < -0.015  # the bottom of the block is at -0.02 m
    assert wall.vertices[:, 2].max() > 0.1
    empty = EndoscopeParams.model_validate(ARMS)
    assert make_place(empty, build(empty), {}, LENS) == []


def test_below_a_liver_no_part_hides_the_triangle() -> None:
    block, body = CutBlock(np.array([0.12, 0.118, 0.032]), 250), SoftBody("liver/nodes")
    body.accept(nodes_of(block.mesh.nodes - [0.0, -0.03, 0.03], block.mesh.triangles))
    params = EndoscopeParams.model_validate(ARMS | {"place": "subhepatic", "skins": {"liver": {}}})
    _, *parts = make_place(params, build(params), {"liver": body}, LENS)
    for part in parts:
        near = np.linalg.norm(part.vertices[:, :2], axis=1) < 0.008
        assert (part.vertices[near, 2] < -0.008).all()
