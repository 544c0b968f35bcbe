"""The shapes of organs, the meshes of users and the materials, without Bullet."""

import contextlib
import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from typer.testing import CliRunner

from engines.bullet.params import BulletParams
from engines.organ_commands import app
from engines.tissue.files.vtk_file import read_vtk
from engines.tissue.meshing.grid import block
from engines.tissue.meshing.isosurface_stuffing import fill
from engines.tissue.meshing.mesh_check import checked_mesh
from engines.tissue.meshing.smoothing import smoothed
from engines.tissue.meshing.tet_mesh import TetMesh, dihedral_angles, shape_quality, volumes
from engines.tissue.organs.catalogue import SHAPES
from engines.tissue.organs.materials import presets
from engines.tissue.organs.params import OrganParams
from hub.recording.file_hashes import file_hashes
from tests.costly import costly

BLOCK = {"size": ["80 mm", "60 mm", "20 mm"], "young_modulus": "10 kPa"}
EXTENTS = {
    "kidney-with-adrenal": (0.137, 0.062, 0.040),
    "colon": (0.120, 0.049, 0.048),
    "liver-lobe": (0.100, 0.124, 0.038),
}
KILOGRAMS = {"kidney-with-adrenal": (0.125, 0.170), "colon": (0.06, 0.10), "liver-lobe": (0.18, 0.24)}


def organ(**given):
    return OrganParams.model_validate(given, context={"directory": Path()})


def ball(points):
    return 0.03 - np.linalg.norm(points, axis=1)


@pytest.mark.parametrize("nodes", [150, 250, 500, 1000])
@pytest.mark.parametrize("name", SHAPES)
def test_every_organ_is_one_sound_body_of_well_shaped_tetrahedra(name, nodes):
    mesh = SHAPES[name].mesh(nodes)
    checked_mesh(mesh.nodes, mesh.tetrahedra)  # closed, one piece, nothing inverted
    angles = np.degrees(dihedral_angles(mesh.nodes, mesh.tetrahedra))
    assert angles.min() > 10
    assert angles.max() < 165
    assert shape_quality(mesh.nodes, mesh.tetrahedra).min() > 0.25
    if nodes >= 250:
        assert len(mesh.nodes) == pytest.approx(nodes, rel=0.15)


@pytest.mark.parametrize("name", SHAPES)
def test_organs_have_the_size_and_the_mass_that_anatomy_says(name):
    params = organ(shape=name, nodes=500)
    np.testing.assert_allclose(np.ptp(params.rest.nodes, axis=0), EXTENTS[name], rtol=0.05)
    low, high = KILOGRAMS[name]
    assert low < params.elastic.density * params.rest.volume < high


@pytest.mark.parametrize("name", SHAPES)
def test_the_same_mesh_comes_every_time_in_whole_micrometres(name):
    mesh = SHAPES[name].mesh(200)
    again = getattr(SHAPES[name].mesh, "__wrapped__", SHAPES[name].mesh)(200)  # past the cache
    np.testing.assert_array_equal(mesh.nodes, again.nodes)
    np.testing.assert_array_equal(mesh.tetrahedra, again.tetrahedra)
    np.testing.assert_array_equal(mesh.nodes, np.round(mesh.nodes, 6))


@costly
@given(st.floats(6e-3, 18e-3))
def test_a_ball_is_filled_to_its_surface_by_tetrahedra_without_slivers(spacing):
    corner = np.full(3, 0.03)
    mesh = smoothed(fill(ball, -corner, corner, spacing), ball, spacing)
    checked_mesh(mesh.nodes, mesh.tetrahedra)
    assert np.degrees(dihedral_angles(mesh.nodes, mesh.tetrahedra)).min() > 25
    np.testing.assert_allclose(np.linalg.norm(mesh.nodes[np.unique(mesh.triangles)], axis=1), 0.03, rtol=1e-6)
    assert (1 - (spacing / 0.03) ** 2) * 4 / 3 * np.pi * 0.03**3 < mesh.volume < 4 / 3 * np.pi * 0.03**3


def test_measures_of_quality_on_a_regular_and_on_a_flat_tetrahedron():
    regular, tetrahedron = np.array([[0.0, 1, 1], [1, 0, 1], [1, 1, 0], [0, 0, 0]]), np.array([[0, 1, 2, 3]])
    if volumes(regular, tetrahedron)[0] < 0:
        tetrahedron = tetrahedron[:, [1, 0, 2, 3]]
    assert shape_quality(regular, tetrahedron) == pytest.approx(1)
    assert dihedral_angles(regular, tetrahedron) == pytest.approx(np.arccos(1 / 3))
    assert shape_quality(regular, tetrahedron[:, [1, 0, 2, 3]]) == pytest.approx(-1)
    regular[3] = regular[:3].mean(axis=0)
    assert shape_quality(regular, tetrahedron) == pytest.approx(0, abs=1e-6)


def test_an_organ_lies_where_and_as_the_scenario_says():
    # a quarter turn about z
    turned = organ(**BLOCK, position=["10 mm", 0, "5 mm"], orientation=[0, 0, 2**-0.5, 2**-0.5])
    assert turned.rest.nodes.min(axis=0) == pytest.approx([0.01 - 0.03, -0.04, 0.005 - 0.02])
    assert turned.rest.nodes.max(axis=0) == pytest.approx([0.01 + 0.03, 0.04, 0.005])
    (bottom,) = turned.anchored_nodes.values()
    assert turned.rest.nodes[bottom][:, 2] == pytest.approx(0.005 - 0.02)


def test_surfaces_by_name_and_by_box():
    block = organ(
        **BLOCK,
        anchors=[{"surface": "left"}, {"box": {"low": ["30 mm", -1, -1], "high": [1, 1, 1]}, "to": "wall"}],
    )
    assert block.local.nodes[block.anchored_nodes["world"]][:, 0] == pytest.approx(-0.04)
    assert block.local.nodes[block.anchored_nodes["wall"]][:, 0].min() >= 0.03
    on_surface = np.zeros(len(block.local.nodes), bool)
    on_surface[np.unique(block.local.triangles)] = True
    assert on_surface[block.anchored_nodes["wall"]].all()
    for name, shape in SHAPES.items():
        for surface in shape.names:
            (chosen,) = organ(shape=name, anchors=[{"surface": surface}]).anchored_nodes.values()
            assert 0 < chosen.sum() < 0.5 * len(chosen)


@pytest.mark.parametrize("name", presets())
def test_every_material_says_where_it_comes_from_and_for_which_loading(name):
    known = presets()[name]
    assert len(known.source) > 30
    assert len(known.loading) > 30
    elastic = organ(size=BLOCK["size"], material=name).elastic
    assert (elastic.young_modulus, elastic.density) == (known.young_modulus, known.density)


@pytest.mark.parametrize(
    ("wrong", "expected"),
    [
        ({"young_modulus": "10 GPa"}, r"1e\+10 Pa is outside 100 \.\. 1e\+07 Pa"),
        ({"young_modulus": "-1 kPa"}, "outside 100"),
        ({"young_modulus": "1 kPa", "poisson_ratio": 0.5}, r"0\.5 is outside 0\.01 \.\. 0\.495"),
        ({"young_modulus": "1 kPa", "poisson_ratio": float("nan")}, "outside 0.01"),
        ({"young_modulus": "1 kPa", "density": "1 kg/m^3"}, "inflated lung"),
        ({"material": "colonn"}, "no material 'colonn'. Did you mean 'colon'"),
        ({"material": "livver", "young_modulus": "1 kPa"}, "no material 'livver'"),
        ({"material": "liver", "density": 1000}, "a material has its own"),
        ({}, "the material is missing"),
    ],
)
def test_materials_outside_nature_or_without_a_source_are_refused(wrong, expected):
    with pytest.raises(ValidationError, match=expected):
        organ(size=BLOCK["size"], **wrong)


def test_an_organ_with_a_modulus_of_its_own_keeps_the_heat_of_its_material():
    own = organ(size=BLOCK["size"], material="fat", young_modulus="10 kPa", density="911 kg/m^3")
    assert own.material_name == "fat"
    assert own.elastic.young_modulus == 10e3
    assert organ(size=BLOCK["size"], young_modulus="10 kPa").material_name is None


@pytest.mark.parametrize(
    ("wrong", "expected"),
    [
        ({}, "one of them"),
        ({"size": BLOCK["size"], "shape": "colon"}, "one of them"),
        ({"shape": "spleen"}, "kidney-with-adrenal"),
        ({"shape": "colon", "unit": "mm"}, "unit is that of a mesh file"),
        ({"shape": "colon", "nodes": 6000}, "5000"),
        ({"shape": "colon", "anchors": [{"surface": "mesentary"}]}, "Did you mean 'mesentery'"),
        ({"shape": "colon", "anchors": [{}]}, "names a surface, or picks nodes"),
        (
            {"shape": "colon", "anchors": [{"box": {"low": [1, 1, 1], "high": [2, 2, 2]}}]},
            "no node of the surface lies in the box",
        ),
        ({"shape": "colon", "orientation": [1, 1, 0, 0]}, "no unit quaternion"),
    ],
)
def test_organs_that_make_no_sense_are_refused(wrong, expected):
    with pytest.raises(ValidationError, match=expected):
        organ(**wrong)


def test_an_organ_anchored_to_a_part_that_there_is_not_is_refused():
    tied = {**BLOCK, "anchors": [{"surface": "bottom", "to": "bedd"}]}
    with pytest.raises(ValidationError, match=r"organ 'o' is anchored to 'bedd'.*Did you mean 'bed'"):
        BulletParams.model_validate({"organs": {"o": tied}, "rigid": {"bed": {"box": [1, 1, 0.1]}}})


def test_parameters_are_the_same_after_a_round_trip_through_json():
    anchors = [
        {"surface": "mesentery", "to": "bed"},
        {"box": {"low": [-1, -1, -1], "high": ["-50 mm", 1, 1]}},
    ]
    given = {
        "organs": {"tube": {"shape": "colon", "anchors": anchors}, "block": BLOCK},
        "rigid": {"bed": {"box": [1, 1, 0.1]}},
    }
    params = BulletParams.model_validate(given)
    assert BulletParams.model_validate_json(params.model_dump_json()) == params


GOOD = block(np.array([0.04, 0.03, 0.02]), 45)


def file_of(path, nodes, tetrahedra):
    TetMesh(nodes, tetrahedra).write_vtk(path)
    return {"mesh": str(path), "material": "liver", "anchors": [{"surface": "bottom"}]}


def test_a_mesh_of_ones_own_works_like_a_shape(tmp_path):
    given = file_of(tmp_path / "organ.vtk", 1e3 * GOOD.nodes, GOOD.tetrahedra)
    params = OrganParams.model_validate(
        {**given, "mesh": "organ.vtk", "unit": "mm"}, context={"directory": tmp_path}
    )
    np.testing.assert_allclose(params.rest.nodes, GOOD.nodes, atol=1e-15)
    np.testing.assert_array_equal(params.rest.tetrahedra, GOOD.tetrahedra)
    (bottom,) = params.anchored_nodes.values()
    assert GOOD.nodes[bottom][:, 2] == pytest.approx(-0.02)
    engine = BulletParams.model_validate(
        {"organs": {"o": {**given, "unit": "mm"}}}, context={"directory": tmp_path}
    )
    assert list(file_hashes([engine], tmp_path)) == [str(tmp_path / "organ.vtk")]


@pytest.mark.parametrize("version", [2, 5])
def test_binary_files_and_those_of_version_5_are_read(tmp_path, version):
    n, m = len(GOOD.nodes), len(GOOD.tetrahedra)
    parts = [
        f"# vtk DataFile Version {version}.1\norgan\nBINARY\n".encode(),
        f"DATASET UNSTRUCTURED_GRID\nPOINTS {n} double\n".encode(),
        GOOD.nodes.astype(">f8").tobytes(),
    ]
    if version == 2:
        parts += [
            f"\nCELLS {m} {5 * m}\n".encode(),
            np.insert(GOOD.tetrahedra, 0, 4, axis=1).astype(">i4").tobytes(),
        ]
    else:
        parts += [
            f"\nCELLS {m + 1} {4 * m}\nOFFSETS vtktypeint64\n".encode(),
            (4 * np.arange(m + 1)).astype(">i8").tobytes(),
        ]
        parts += [b"\nCONNECTIVITY vtktypeint64\n", GOOD.tetrahedra.astype(">i8").tobytes()]
    parts += [f"\nCELL_TYPES {m}\n".encode(), np.full(m, 10).astype(">i4").tobytes()]
    (tmp_path / "organ.vtk").write_bytes(b"".join(parts))
    nodes, tetrahedra = read_vtk(tmp_path / "organ.vtk")
    np.testing.assert_array_equal(nodes, GOOD.nodes)
    np.testing.assert_array_equal(tetrahedra, GOOD.tetrahedra)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_damaged_file_is_refused_or_read_but_nothing_else(tmp_path, data):
    GOOD.write_vtk(tmp_path / "organ.vtk")
    content = (tmp_path / "organ.vtk").read_bytes()
    at = data.draw(st.integers(0, len(content) - 1))
    put = data.draw(
        st.one_of(
            st.binary(max_size=6),
            st.sampled_from([b"nan ", b"-1 ", b"99999999999 ", b"1e300 ", b"OFFSETS x\n", b"CELLS 3 9\n"]),
        )
    )
    content = content[:at] + put + content[at + data.draw(st.integers(0, 30)) :]
    (tmp_path / "organ.vtk").write_bytes(
        content.replace(b"ASCII", b"BINARY") if data.draw(st.booleans()) else content
    )
    with contextlib.suppress(ValueError):
        checked_mesh(*read_vtk(tmp_path / "organ.vtk"))


def flipped(some):
    tetrahedra = GOOD.tetrahedra.copy()
    tetrahedra[some] = tetrahedra[some][:, [1, 0, 2, 3]]
    return GOOD.nodes, tetrahedra


def flattened():
    nodes = GOOD.nodes.copy()
    corner = GOOD.tetrahedra[0]
    nodes[corner[0]] = nodes[corner[1:]].mean(axis=0)
    return nodes, GOOD.tetrahedra


def not_finite():
    nodes = GOOD.nodes.copy()
    nodes[7, 1] = np.nan
    return nodes, GOOD.tetrahedra


def cracked():
    nodes, tetrahedra = np.concatenate([GOOD.nodes, GOOD.nodes[:1]]), GOOD.tetrahedra.copy()
    tetrahedra[np.flatnonzero((tetrahedra == 0).any(axis=1))[0]] = np.where(
        tetrahedra[(tetrahedra == 0).any(axis=1)][0] == 0, len(GOOD.nodes), tetrahedra[0]
    )
    return nodes, tetrahedra


def pair(shared):
    """Return two tetrahedra that share `shared` nodes."""
    first = np.array([[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.01]])
    second = -first
    if shared == 0:
        second = first + 0.1
    if shared == 2:
        second = np.array([[0, 0, 0], [0.01, 0, 0], [0, -0.01, 0], [0, 0, -0.01]])
    nodes, number = np.unique(np.concatenate([first, second]), axis=0, return_inverse=True)
    tetrahedra = number.reshape(2, 4)
    wrong = volumes(nodes, tetrahedra) < 0
    tetrahedra[wrong] = tetrahedra[wrong][:, [1, 0, 2, 3]]
    return nodes, tetrahedra


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        (flipped([3, 5]), "2 of .* tetrahedra are inverted: 3, 5"),
        (flipped(slice(None)), "all tetrahedra are inverted: swap two nodes"),
        (flattened(), r"tetrahedra are degenerate.*: 0"),
        (not_finite(), "1 nodes are not finite: 7"),
        (
            (np.append(GOOD.nodes, [[0, 0, 0.001]], axis=0), GOOD.tetrahedra),
            f"1 nodes belong to no tetrahedron: {len(GOOD.nodes)}",
        ),
        (
            (GOOD.nodes, np.append(GOOD.tetrahedra, [[0, 1, 2, 999]], axis=0)),
            "1 tetrahedra name nodes that there are not",
        ),
        (
            (GOOD.nodes, np.append(GOOD.tetrahedra, GOOD.tetrahedra[-1:], axis=0)),
            "not watertight|three tetrahedra or more",
        ),
        (cracked(), "lie where others are, so the mesh is cracked"),
        (pair(0), "in 2 pieces"),
        (pair(1), "in 2 pieces"),
        (pair(2), "not watertight: 1 edges"),
        ((1e3 * GOOD.nodes, GOOD.tetrahedra), "40 m large: is the file in millimetres"),
        ((1e-3 * GOOD.nodes, GOOD.tetrahedra), "0.04 mm large: is the file in metres"),
        ((np.zeros((6000, 3)), GOOD.tetrahedra), "6000 nodes.*4 to 5000"),
    ],
)
def test_a_bad_mesh_is_refused_with_what_is_wrong(tmp_path, mesh, expected):
    with pytest.raises(ValidationError, match=expected):
        organ(**file_of(tmp_path / "organ.vtk", *mesh))


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("solid stl", "not a legacy .vtk file"),
        ("# vtk DataFile Version 2.0\nx\nASCII\nDATASET POLYDATA\n", "dataset 'POLYDATA'"),
        ("# vtk DataFile Version 2.0\nx\nUTF8\n", "not ASCII or BINARY"),
        (
            "# vtk DataFile Version 2.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1",
            "ends too early",
        ),
        (
            f"# vtk DataFile Version 2.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {10**20} float\n",
            "ends too early",
        ),
        (
            "# vtk DataFile Version 2.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 float\n0 x 0\n",
            "something else",
        ),
        (
            "# vtk DataFile Version 2.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS many float\n",
            "does not state how many",
        ),
        (
            "# vtk DataFile Version 2.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 float\n0 0 0\n",
            "has no CELLS, CELL_TYPES",
        ),
        (
            (
                "# vtk DataFile Version 2.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 3 float\n0 0 0 1 0 0"
                " 0 1 0\nCELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n5\n"
            ),
            "must be tetrahedra.*1 of type 5",
        ),
    ],
)
def test_a_file_without_tetrahedra_is_refused(tmp_path, content, expected):
    (tmp_path / "organ.vtk").write_text(content)
    with pytest.raises(ValidationError, match=expected):
        organ(mesh=str(tmp_path / "organ.vtk"), material="liver", anchors=[])


@pytest.mark.parametrize(
    "content",
    [
        f"# vtk DataFile Version 2.0\nx\nASCII\nDATASET {'x' * 30_000}\n",
        f"# vtk DataFile Version 2.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 float\n"
        f"0 {'x' * 30_000} 0\n",
    ],
)
def test_words_of_any_length_are_quoted_in_part(tmp_path, content):
    (tmp_path / "organ.vtk").write_text(content)
    with pytest.raises(ValueError, match=r"organ\.vtk: holds") as caught:
        read_vtk(tmp_path / "organ.vtk")
    assert len(str(caught.value)) < 1_000


def test_a_pipe_has_no_end_and_is_not_read(tmp_path):
    os.mkfifo(tmp_path / "organ.vtk")
    with pytest.raises(ValidationError, match="something else than regular files"):
        organ(mesh=str(tmp_path / "organ.vtk"), material="liver", anchors=[])


def test_a_mesh_that_is_not_there_and_one_that_nothing_holds(tmp_path):
    with pytest.raises(ValidationError, match=r"gone\.vtk cannot be read: No such file"):
        organ(mesh=str(tmp_path / "gone.vtk"), material="liver", anchors=[])
    given = file_of(tmp_path / "organ.vtk", GOOD.nodes, GOOD.tetrahedra)
    with pytest.raises(ValidationError, match="state what holds the organ"):
        organ(**{key: value for key, value in given.items() if key != "anchors"})
    with pytest.raises(ValidationError, match="nodes are those of the mesh file"):
        organ(**given, nodes=100)


@pytest.mark.long
def test_the_command_prints_shapes_and_materials():
    text = CliRunner().invoke(app, ["--nodes", "150"]).output
    assert "kidney-with-adrenal" in text
    assert "doi:10.1002/jmri.22670" in text
    found = json.loads(CliRunner().invoke(app, ["--nodes", "150", "--json"]).output)
    assert set(found["shapes"]) == set(SHAPES)
    assert found["shapes"]["colon"]["volume"] == pytest.approx(SHAPES["colon"].mesh(150).volume)
    assert found["materials"]["liver"]["young_modulus"] == presets()["liver"].young_modulus
