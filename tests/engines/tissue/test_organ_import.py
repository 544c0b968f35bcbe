"""Organs of files of other programs: ten ugly surfaces, tetrahedra, units, and what is refused."""

import re
import subprocess
import sys

import meshio
import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from engines.organ_commands import app
from engines.tissue.files import foreign_file, mesh_file
from engines.tissue.meshing.grid import block
from engines.tissue.meshing.tet_mesh import shape_quality
from engines.tissue.organ_import import import_organ
from engines.tissue.organs.params import OrganParams
from schemas.errors import MissingExtraError, ScenarioError
from schemas.files import Files
from tests.engines.tissue.ugly_surfaces import UGLY, ellipsoid, write_stl

USABLE = {  # volume in ml, and a word of the report
    "holes": (179, "holes there are closed"),
    "self_intersection": (286, "unit m"),
    "duplicate_vertices": (179, "unit m"),
    "inverted_normals": (179, "171 triangles faced the other way"),
    "high_genus": (93, "unit m"),
    "millimetres": (179, "unit mm, as the longest side is then 100 mm"),
    "slivers": (63, "40 triangles had no area"),
}
REFUSED = {
    "thin_sheet": "too thin for 250 nodes.*bring the tetrahedra",
    "two_parts": "2 parts .*--part 1",
    "open_disc": "no inside.*Close it",
}


def written(tmp_path, name):
    file = tmp_path / f"{name}.stl"
    file.write_bytes(write_stl(UGLY[name]()))
    return file


def organ_of(file, **more):
    """Return the organ as a scenario beside `file` has it."""
    return OrganParams.model_validate(
        {"mesh": file.name, "material": "liver", **more}, context=Files(file.parent).context
    )


def test_every_ugly_surface_is_usable_or_refused():
    assert {*USABLE, *REFUSED} == set(UGLY)


@pytest.mark.long
@pytest.mark.parametrize("name", USABLE)
def test_a_usable_surface_gives_a_sound_mesh_of_about_as_many_nodes(tmp_path, name):
    volume, said = USABLE[name]
    organ = import_organ([written(tmp_path, name)], nodes=250)
    assert 225 <= len(organ.mesh.nodes) <= 275
    assert organ.mesh.volume * 1e6 == pytest.approx(volume, rel=0.1)
    assert shape_quality(organ.mesh.nodes, organ.mesh.tetrahedra).min() > 0.5
    assert said in "; ".join(organ.report)


@pytest.mark.long
@pytest.mark.parametrize("name", REFUSED)
def test_an_unusable_surface_is_refused_with_reason_and_remedy(tmp_path, name):
    file = written(tmp_path, name)
    with pytest.raises(ScenarioError, match=f"{re.escape(str(file))}.*{REFUSED[name]}"):
        import_organ([file])


@pytest.mark.long
def test_a_part_of_several_is_chosen(tmp_path):
    organ = import_organ([written(tmp_path, "two_parts")], part=2)
    assert organ.mesh.volume * 1e6 == pytest.approx(179, rel=0.1)
    with pytest.raises(ScenarioError, match="no part 3"):
        import_organ([written(tmp_path, "two_parts")], part=3)


@pytest.mark.long
def test_the_command_writes_an_organ_for_scenarios_and_a_picture(tmp_path):
    file, output = written(tmp_path, "millimetres"), tmp_path / "mine.yaml"
    arguments = ["import", str(file), "-o", str(output), "--material", "liver", "--anchor", "bed"]
    done = CliRunner().invoke(app, [*arguments, "--surface", "bed={normal: -z, within: 40 deg}"])
    assert done.exit_code == 0, done.output
    assert "organs: {mine: {mesh: mine.yaml, material: liver}}" in done.output
    assert (tmp_path / "mine.png").is_file() or "no picture: no OpenGL works here" in done.output
    organ = OrganParams.model_validate({"mesh": "mine.yaml"}, context=Files(tmp_path).context)
    (held,) = organ.anchored_nodes.values()
    assert 10 < held.sum() < 80
    assert organ.local.nodes[held][:, 2].max() < organ.local.nodes[:, 2].mean()
    assert organ.local.nodes[:, 2].max() == pytest.approx(0.0, abs=1e-6)
    text = output.read_text(encoding="utf-8")
    (tmp_path / "broken.yaml").write_text(text.replace("POINTS", "PIONTS"), encoding="utf-8")
    with pytest.raises(ValueError, match="has no POINTS"):
        OrganParams.model_validate({"mesh": "broken.yaml"}, context=Files(tmp_path).context)


@pytest.mark.long
@pytest.mark.parametrize("suffix", [".stl", ".obj", ".ply", ".glb"])
def test_a_scenario_names_a_surface_of_any_kind(tmp_path, suffix):
    file = tmp_path / f"organ{suffix}"
    trimesh.Trimesh(*ellipsoid(), process=False).export(file)
    organ = organ_of(file, nodes=100, anchors=[{"normal": "-z"}])
    assert 85 < len(organ.local.nodes) < 115
    assert sorted(np.ptp(organ.local.nodes, axis=0)) == pytest.approx([0.05, 0.07, 0.1], rel=0.1)
    upwards = 1 if suffix == ".glb" else 2  # y is up in glTF
    assert np.ptp(organ.local.nodes, axis=0)[2] == pytest.approx([0.1, 0.07, 0.05][upwards], rel=0.1)


@pytest.mark.parametrize("suffix", [".vtu", ".msh", ".med"])
def test_a_scenario_names_tetrahedra_of_any_kind(tmp_path, suffix):
    mesh = block(np.array([60.0, 60.0, 20.0]), 100)
    file = tmp_path / f"organ{suffix}"
    cells = [("triangle", mesh.triangles), ("tetra", mesh.tetrahedra)]
    format_of = {".vtu": "vtu", ".msh": "gmsh22", ".med": "med"}
    points = np.vstack([mesh.nodes, [[0.0, 0.0, 500.0]]])  # a node without a tetrahedron
    meshio.Mesh(points, cells).write(file, file_format=format_of[suffix])
    organ = organ_of(file, unit="mm", anchors=[{"surface": "bottom"}])
    np.testing.assert_allclose(organ.local.nodes, 1e-3 * mesh.nodes, atol=1e-9)
    assert organ.local.volume == pytest.approx(72e-6)


def test_tetrahedra_are_kept_or_meshed_anew(tmp_path):
    mesh = block(np.array([0.06, 0.06, 0.04]), 200)
    mesh.write_vtk(file := tmp_path / "organ.vtk")
    assert len(import_organ([file], keep_origin=True).mesh.nodes) == len(mesh.nodes)
    organ = import_organ([file], nodes=400)
    assert 350 < len(organ.mesh.nodes) < 450
    assert "meshed anew" in organ.report[1]


SUFFIXES = ".stl", ".obj", ".ply", ".glb", ".gltf", ".vtu", ".msh", ".med", ".vtk"
RUBBISH = b"", b"\0" * 200, b"solid of nothing\n", b"\x80\x04K\x01."


@pytest.mark.parametrize(
    ("suffix", "content"),
    [
        pytest.param(suffix, content, marks=pytest.mark.search if (at + of) % len(RUBBISH) else ())
        for at, suffix in enumerate(SUFFIXES)
        for of, content in enumerate(RUBBISH)
    ],
)
def test_a_file_of_something_else_is_refused_with_its_name(tmp_path, suffix, content):
    file = tmp_path / f"organ{suffix}"
    file.write_bytes(content)
    with pytest.raises(ScenarioError, match=re.escape(str(file))):
        import_organ([file])


def test_files_that_are_no_meshes_are_refused_before_they_are_opened(tmp_path, monkeypatch):
    with pytest.raises(ScenarioError, match=r"'\.exe' is not read; surfaces: \.stl"):
        import_organ([tmp_path / "organ.exe"])
    (tmp_path / "folder.stl").mkdir()
    with pytest.raises(ScenarioError, match="is no file"):
        import_organ([tmp_path / "folder.stl"])
    file = written(tmp_path, "holes")
    monkeypatch.setattr(foreign_file, "_LARGEST_FILE", 1000)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: pytest.fail("parsed"))
    with pytest.raises(ScenarioError, match="decimate it"):
        import_organ([file])


def test_a_parser_that_does_not_end_is_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr(foreign_file, "_PATIENCE_S", 0.01)
    with pytest.raises(ScenarioError, match="took more than"):
        import_organ([written(tmp_path, "holes")])


def test_without_the_extra_the_command_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(foreign_file, "find_spec", lambda _: None)
    with pytest.raises(MissingExtraError, match=r"pip install 'trocar\[meshes\]'"):
        import_organ([written(tmp_path, "holes")])


def test_a_surface_opens_no_second_file(tmp_path):
    """The parser is given no resolver: a material file beside an .obj is not read."""
    surface = ellipsoid(halvings=1)
    (tmp_path / "secret.mtl").mkdir()
    rows = ["mtllib secret.mtl", *(f"v {x} {y} {z}" for x, y, z in surface.vertices)]
    rows += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in surface.triangles]
    (tmp_path / "organ.obj").write_text("\n".join(rows))
    assert len(mesh_file.read_surface(tmp_path / "organ.obj").triangles) == 32


@pytest.mark.long
def test_the_unit_is_stated_where_no_guess_makes_an_organ(tmp_path):
    file = tmp_path / "organ.stl"
    surface = ellipsoid()
    file.write_bytes(write_stl(surface._replace(vertices=20.0 * surface.vertices)))  # 2 units
    with pytest.raises(ScenarioError, match="state --unit, one of m, cm, mm"):
        import_organ([file])
    organ = import_organ([file], unit="cm", nodes=100)
    assert np.ptp(organ.mesh.nodes, axis=0).max() == pytest.approx(0.02, rel=0.1)


@pytest.mark.long
def test_an_unknown_anchor_or_an_empty_pick_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match=r"no surface 'botom'.*Did you mean 'bottom'"):
        import_organ([written(tmp_path, "holes")], nodes=60, anchors=["botom"])
    far = ["--surface", "far={box: {low: [1, 1, 1], high: [2, 2, 2]}}"]
    wrong = ["--surface", "far={normal: up}"]
    arguments = ["import", str(written(tmp_path, "holes")), "-o", str(tmp_path / "o.yaml"), "--nodes", "60"]
    done = CliRunner().invoke(app, [*arguments, *far])
    assert "surface 'far' has no node" in str(done.exception)
    done = CliRunner().invoke(app, [*arguments, *wrong])
    assert done.exit_code == 2
    assert "no direction" in done.output


def test_the_parser_limits_its_memory(tmp_path):
    """A result above the limit ends the parser, not the parent."""
    code = (
        "from engines.tissue.files import parser; parser._MEMORY = 10**9; parser.limit_resources();"
        "import numpy; numpy.ones(10**9)"
    )
    if sys.platform == "win32":
        pytest.skip("no limits of resources on Windows")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "MemoryError" in done.stderr
