"""What a page gets to draw a scene as an endoscope sees it."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from engines.mujoco.params import MujocoParams
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.page_appearance import page_appearance
from engines.mujoco.textures.atlas import Atlas, picture_side
from engines.mujoco.textures.coats import COATS, KINDS
from engines.mujoco.textures.noise import SEED, Noise
from engines.mujoco.textures.tissues import TISSUES
from engines.tissue.meshing.grid import block
from hub.participant.appearance import RestBody

ARM = {"PSM1": {"instrument": "LARGE_NEEDLE_DRIVER_400006"}}
MESH = block(np.array([0.08, 0.06, 0.02]), 60)
BODY = RestBody(MESH.nodes.astype(np.float32), MESH.triangles.astype(np.uint32))


def pixels(picture):
    return np.asarray(Image.open(BytesIO(picture))).astype(np.float64)


@pytest.fixture(scope="module")
def abdomen():
    params = EndoscopeParams.model_validate({"arms": ARM, "skins": {"organ": {"colour": "liver"}}})
    return page_appearance(params, {"organ": BODY})


@pytest.mark.long
def test_the_skin_is_the_one_of_the_endoscope(abdomen):
    skin = abdomen.skins["organ"]
    atlas = Atlas(MESH.nodes, MESH.triangles.astype(np.int64), picture_side(1))
    maps = atlas.paint(TISSUES["liver"], Noise(SEED))
    assert skin.uv.shape == (len(MESH.triangles), 3, 2)
    assert (skin.uv >= 0.0).all()
    assert (skin.uv <= 1.0).all()
    assert np.array_equal(skin.charts, atlas.chart)
    for picture, made in (
        (skin.texture.colour, maps.colour),
        (skin.texture.normal, maps.normal),
        (skin.texture.roughness, maps.orm[..., 1]),
    ):
        difference = np.abs(pixels(picture) - made)
        assert difference.mean() < 4.0, "grey levels lost in the file"


@pytest.mark.long
def test_coats_and_kinds_of_faces_have_tiles(abdomen):
    assert abdomen.kinds.keys() == KINDS.keys()
    assert set(COATS) <= abdomen.coats.keys()
    assert abdomen.coats["steel"].metal > 0.5 > abdomen.coats["black"].metal
    for coat in (*abdomen.kinds.values(), *abdomen.coats.values()):
        assert coat.tile_m > 0.0
        assert pixels(coat.texture.colour).shape == (256, 256, 3)


@pytest.mark.long
def test_the_place_is_the_one_of_the_scene(abdomen):
    assert abdomen.place == "abdomen"
    assert len(abdomen.surroundings) > 2
    for part in abdomen.surroundings:
        assert len(part.uv) == len(part.vertices) > int(part.faces.max())
    table = {"position": ["0 m", "0 m", "-50 mm"], "size": ["200 mm", "200 mm", "10 mm"]}
    lab = page_appearance(MujocoParams.model_validate({"arms": ARM, "table": table}), {})
    assert lab.place == "dry-lab"
    bare = page_appearance(MujocoParams.model_validate({"arms": ARM}), {})
    assert (bare.place, bare.surroundings) == ("none", ())


@pytest.mark.long
def test_a_robot_without_endoscope_shows_bodies_by_their_names():
    found = page_appearance(MujocoParams.model_validate({"arms": ARM}), {"left_liver": BODY})
    assert found.place == "abdomen"
    atlas = Atlas(MESH.nodes, MESH.triangles.astype(np.int64), picture_side(1))
    liver = atlas.paint(TISSUES["liver"], Noise(SEED)).colour
    assert np.abs(pixels(found.skins["left_liver"].texture.colour) - liver).mean() < 4.0
