"""A label map becomes the organs of a patient: repaired, smooth, not shrunk, attached where they touch."""

import numpy as np
import pytest
from typer.testing import CliRunner

from engines.fem.engine import FemEngine
from engines.fem.params import FemParams
from engines.organ_commands import app
from engines.tissue.example_patient import LABELS, example_labels, write_example
from engines.tissue.files.label_file import LabelMap
from engines.tissue.meshing.label_field import LabelField
from engines.tissue.meshing.label_repair import repair_voxels
from engines.tissue.meshing.tet_mesh import shape_quality
from engines.tissue.organs.label_body import cut_out
from engines.tissue.organs.label_tube import trace_tube
from engines.tissue.organs.params import OrganParams
from engines.tissue.patient_import import import_patient
from engines.tissue.patient_tube import make_tube
from hub.participant import Inputs, Setup
from hub.planning import scenario_file
from schemas.errors import ScenarioError
from schemas.files import Files

MM = np.array([[1e-3, 0.0, 0.0, 0.0], [0.0, 1e-3, 0.0, 0.0], [0.0, 0.0, 1e-3, 0.0]])


def ball(radius, shape=(30, 30, 30), spacing=(1.0, 1.0, 1.0)):
    """Return the voxels of a ball around the middle; spacing in mm."""
    places = (np.moveaxis(np.indices(shape), 0, -1) - 0.5 * (np.array(shape) - 0.7)) * spacing
    return np.linalg.norm(places, axis=-1) < radius


@pytest.mark.parametrize("spacing", [(1.0, 1.0, 1.0), (0.8, 0.8, 3.0)])
def test_a_field_is_smooth_and_keeps_the_volume(spacing):
    shape = tuple(round(30 / edge) for edge in spacing)
    inside = ball(10.0, shape, spacing)
    field = LabelField(inside, MM * [*spacing, 1.0])
    assert field.volume == pytest.approx(field.raw_volume, rel=1e-3)
    middle = 1e-3 * 0.5 * (np.array(shape) - 0.7) * spacing
    ways = np.random.default_rng(1).normal(size=(500, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    reach = np.linspace(6e-3, 14e-3, 161)
    depth = field((middle + reach[:, None, None] * ways).reshape(-1, 3)).reshape(161, 500)
    radii = reach[(depth > 0.0).sum(axis=0)]
    assert radii.mean() == pytest.approx(10e-3, abs=0.1e-3)
    assert np.abs(radii - radii.mean()).max() < 0.45e-3 * spacing[2]


def test_a_thin_tube_keeps_its_place():
    inside = ball(2.0, (1, 13, 13)).repeat(30, axis=0)
    field = LabelField(inside, MM)
    line = np.stack([np.linspace(8e-3, 20e-3, 20), np.full(20, 6.15e-3), np.full(20, 6.15e-3)], axis=1)
    for side in np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.6, 0.8]]):
        assert (field(line + 1.6e-3 * side) > 0.0).all()
        assert (field(line + 2.4e-3 * side) < 0.0).all()


def test_islands_holes_and_bridges_are_repaired_and_said():
    inside = ball(8.0)
    whole = inside.copy()
    inside[:3, :3, :3] = True  # an island
    inside[14:16, 14, 14] = False  # a hole
    inside[14, 14, 23:26] = True  # a bridge to a blob
    inside[13:16, 13:16, 26:29] = True
    repaired, changes = repair_voxels(inside, ~inside)
    assert [change.split()[0] for change in changes] == ["27", "2", "28"]
    assert (repaired != whole).sum() <= 3
    assert repair_voxels(whole, ~whole) == (pytest.approx(whole), [])


def test_another_organ_in_a_hole_stays_and_two_parts_are_refused():
    inside = ball(8.0)
    inside[14:16, 14, 14] = False
    kept, changes = repair_voxels(inside, np.zeros_like(inside))
    assert not changes
    assert (kept == inside).all()
    two = np.concatenate([ball(8.0), ball(7.0)])
    with pytest.raises(ValueError, match=r"2 parts \(.* voxels\).*label of its own"):
        repair_voxels(two, ~two)
    two[29:31, 14, 14] = True
    two[22:38, 14, 14] = True
    with pytest.raises(ValueError, match="2 parts joined by bridges"):
        repair_voxels(two, ~two)


def test_voxels_that_are_no_organ_are_refused():
    labels = ball(8.0).astype(np.uint16)
    ends = np.zeros((2, 3), np.bool_)
    with pytest.raises(ValueError, match=r"sand is 0.016 mm large.*--unit"):
        cut_out(LabelMap(labels, 1e-3 * MM, ends, {}, []), "sand", 1)
    with pytest.raises(ValueError, match=r"nothing .label 2. has 0 voxels"):
        cut_out(LabelMap(labels, MM, ends, {}, []), "nothing", 2)
    half = labels[:15]
    low, high = half.any(axis=(1, 2)).argmax(), 15
    ends[1, 0] = True
    cut = cut_out(LabelMap(half[low:high], MM, ends, {}, []), "half", 1)
    assert cut.changes == ["it is cut off where the scan ends"]


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """Return the example as 3D Slicer saves it."""
    write_example(file := tmp_path_factory.mktemp("scan") / "scan.seg.nrrd", seed=7)
    return file


@pytest.fixture(scope="module")
def patient(scan):
    return import_patient(scan, {})


@pytest.mark.long
def test_organs_have_the_volume_of_their_voxels_and_a_sound_mesh(patient):
    assert list(patient.organs) == list(LABELS)
    for organ in patient.organs.values():
        mesh = organ.mesh
        tolerance = 0.15 if organ.name == "cystic_duct" else 0.02  # drawn onto a coarse neck
        assert organ.made.volume_ratio == pytest.approx(1.0, abs=tolerance)
        assert shape_quality(mesh.nodes, mesh.tetrahedra).min() > 0.3
        assert organ.made.distances[1] < 3.2e-3
    assert 1400 < sum(len(organ.mesh.nodes) for organ in patient.organs.values()) < 1800
    said = patient.organs["liver"].report
    assert [line.split()[2] + " " + line.split()[3] for line in said[:3]] == [
        "in islands",
        "in closed",
        "behind thin",
    ]


@pytest.mark.long
def test_all_organs_are_in_one_frame_of_an_operation(patient):
    """The example lies as in an operation: the fundus cranial of the duct, both anterior of the liver."""
    middles = {name: organ.mesh.nodes.mean(axis=0) for name, organ in patient.organs.items()}
    assert middles["gallbladder"][1] > middles["cystic_duct"][1] + 0.03
    assert middles["cystic_duct"][0] > middles["gallbladder"][0] + 0.01
    assert middles["gallbladder"][2] > middles["liver"][2] + 0.02
    nodes = np.concatenate([organ.mesh.nodes for organ in patient.organs.values()])
    assert nodes[:, 2].max() == pytest.approx(0.0, abs=2e-3)
    assert nodes.min(axis=0)[:2] + nodes.max(axis=0)[:2] == pytest.approx([0.0, 0.0], abs=4e-3)


@pytest.mark.long
def test_organs_that_touch_have_surfaces_there_and_hang_together(patient):
    bed, neck = patient.contacts
    assert set(bed.organs) == {"gallbladder", "liver"}
    assert neck.organs == ("cystic_duct", "gallbladder")
    assert 600e-6 < bed.area < 1300e-6
    assert 10e-6 < neck.area < 60e-6
    assert max(bed.within, neck.within) < 2.5e-3
    gallbladder, liver = patient.organs["gallbladder"], patient.organs["liver"]
    picked = gallbladder.surfaces["to_liver"].nodes(gallbladder.mesh)
    assert gallbladder.mesh.nodes[picked, 2].mean() < gallbladder.mesh.nodes[:, 2].mean() - 2e-3
    assert liver.surfaces["to_gallbladder"].nodes(liver.mesh).sum() > 5
    assert [organ.anchors for organ in patient.organs.values()] == [("posterior",), (), ()]


@pytest.mark.long
def test_the_command_writes_a_patient_that_runs(scan, tmp_path):
    output = tmp_path / "mine.yaml"
    arguments = ["import", str(scan), "-o", str(output), "--nodes", "300"]
    arguments += ["--labels", "gb=Gallbladder,duct=3", "--surface", "gb.fundus={normal: +y}"]
    arguments += ["--tube", "duct=1 mm"]
    done = CliRunner().invoke(app, [*arguments, "--anchor", "gb.bottom", "--material", "gb=colon"])
    assert done.exit_code == 0, done.output
    assert "left at gb, right at no organ: held" in done.output
    assert "held at bottom" in done.output
    assert "a step of 1 ms takes" in done.output
    assert (tmp_path / "mine.png").is_file() or "no picture: no OpenGL works here" in done.output
    assert scenario_file.load(output).scenario.participants["tissue"].kind == "fem"
    organ = OrganParams.model_validate({"mesh": "mine-gb.yaml"}, context=Files(tmp_path).context)
    assert organ.material_name == "colon"
    assert {"fundus", "bottom"} <= set(organ.body.names)
    fundus = organ.body.picks["fundus"].nodes(organ.local)
    assert organ.local.nodes[fundus, 1].min() > organ.local.nodes[:, 1].mean()


@pytest.mark.long
def test_the_organs_hang_at_rest_by_their_attachments(patient, tmp_path):
    organs = {}
    for name, organ in patient.organs.items():
        (tmp_path / f"{name}.yaml").write_text(organ.file(patient.source).text(), encoding="utf-8")
        anchors = [{"surface": anchor} for anchor in organ.anchors]
        organs[name] = {"mesh": f"{name}.yaml", "anchors": anchors}
    plates = {
        name: {"organs": one.organs, "surface": f"to_{one.organs[1]}", "within": one.within, "strength": 1e5}
        for name, one in zip(("plate", "neck"), patient.contacts, strict=True)
    }
    given = {"organs": organs, "attachments": plates}
    params = FemParams.model_validate(given, context=Files(tmp_path).context)
    outputs = {}
    with FemEngine("tissue", params) as engine:
        engine.configure(Setup(1_000_000, tmp_path, {}))
        for k in range(50):
            outputs |= engine.step(k * 1_000_000, 1_000_000, Inputs({}))
    weight = 9.81 * 1060.0 * sum(patient.organs[name].mesh.volume for name in ("gallbladder", "cystic_duct"))
    assert np.abs(outputs["plate/force"]) == pytest.approx([0.0, 0.0, weight], abs=0.1 * weight)
    assert outputs["plate/freed"] == outputs["neck/freed"] == 0.0


def bent_tube(radius=3.0):
    """Return the body of a tube along a quarter of a circle of 20 mm, in voxels of 1 mm."""
    places = np.moveaxis(np.indices((36, 36, 15)), 0, -1) - [6.3, 6.3, 7.3]
    around = np.hypot(places[..., 0], places[..., 1]) - 20.0
    inside = np.hypot(around, places[..., 2]) < radius
    inside &= (places[..., :2] > 0.0).all(axis=-1)
    return cut_out(LabelMap(inside.astype(np.uint16), MM, np.zeros((2, 3), np.bool_), {}, []), "duct", 1)


def test_a_tube_has_its_middle_line_and_diameters():
    tube = trace_tube(bent_tube())
    centred = 1e3 * tube.path - [6.3, 6.3, 7.3]
    assert np.hypot(centred[:, 0], centred[:, 1]) == pytest.approx(20.0, abs=1.0)
    assert centred[:, 2] == pytest.approx(0.0, abs=0.3)
    assert 1e3 * tube.diameters == pytest.approx(6.0, abs=0.7)
    length = 1e3 * np.linalg.norm(np.diff(tube.path, axis=0), axis=1).sum()
    assert length == pytest.approx(10.0 * np.pi, abs=1.5)


def test_what_is_no_tube_is_refused():
    crossed = ball(3.0, (1, 30, 30)).repeat(30, axis=0)
    crossed |= crossed.transpose(1, 0, 2)
    for inside in (ball(8.0), crossed):
        labels = LabelMap(inside.astype(np.uint16), MM, np.zeros((2, 3), np.bool_), {}, [])
        with pytest.raises(ValueError, match="no tube without branches"):
            trace_tube(cut_out(labels, "duct", 1))
    with pytest.raises(ValueError, match=r"3 mm leaves no lumen.* mm at most"):
        make_tube(trace_tube(bent_tube()), 3e-3, [])


def test_a_duct_becomes_a_hollow_tube_on_its_organ(scan):
    chosen = {"gb": "2", "duct": "3"}
    patient = import_patient(scan, chosen, nodes=300, tubes={"duct": 1e-3})
    (duct,) = patient.tubes
    assert list(patient.organs) == ["gb"]
    (joint,) = duct.joints
    assert (joint.organ, joint.end) == ("gb", "left")
    assert 0.2e-3 < joint.within < 4e-3
    assert duct.params["anchors"] == [{"surface": "right"}]
    assert duct.params["lumen"]["liquid"] == "bile"
    organ = OrganParams.model_validate(duct.params)
    assert organ.inner_wall is not None
    assert 4e-3 < np.mean(duct.params["tube"]["diameters"]) < 8e-3
    with pytest.raises(ScenarioError, match="no organ 'duct'"):
        import_patient(scan, chosen, anchors={"duct": ["left"]}, tubes={"duct": 1e-3})


@pytest.mark.parametrize(
    ("labels", "reason"),
    [
        ({"spleen": "7"}, r"no label '7' for spleen; it has 1 \(liver, 3.* ml\), 2 \(gallbladder"),
        ({"a": "1", "b": "liver"}, "the same label"),
        ({"1st": "1"}, "no name"),
    ],
)
def test_labels_that_are_not_there_are_refused_with_what_is(scan, labels, reason):
    with pytest.raises(ScenarioError, match=reason):
        import_patient(scan, labels)


def test_unknown_organs_and_surfaces_are_refused(scan):
    chosen = {"gb": "2"}
    with pytest.raises(ScenarioError, match=r"no organ 'bg'. Known: gb"):
        import_patient(scan, chosen, anchors={"bg": ["top"]})
    with pytest.raises(ScenarioError, match=r"gb has no surface 'topp'.*Did you mean 'top'"):
        import_patient(scan, chosen, nodes=100, anchors={"gb": ["topp"]})
    done = CliRunner().invoke(app, ["import", str(scan), "-o", "o.yaml", "--anchor", "top"])
    assert "not ORGAN.SURFACE" in done.output


def test_the_example_is_the_same_for_a_seed_and_another_for_another():
    one, other = example_labels(7), example_labels(8)
    assert set(np.unique(one)) == {0, 1, 2, 3}
    assert (one != other).mean() > 0.002
    assert (one == example_labels(7)).all()
