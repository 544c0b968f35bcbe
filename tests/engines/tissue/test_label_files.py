"""Label maps of strangers: where voxels are, names of segments, and what is refused before it is unpacked."""

import bz2
import gzip
import re
import zlib
from pathlib import Path

import nibabel
import nrrd
import numpy as np
import pytest

from engines.tissue.files import foreign_file
from engines.tissue.files.label_file import is_label_map, read_labels
from engines.tissue.files.label_parser import parse_labels
from schemas.errors import MissingExtraError

AT = {"left": 40.0, "posterior": 20.0, "superior": 10.0}
"""Middle of a blob in the patient, mm."""
SPACES = {
    "left-posterior-superior": (1, 1, 1),
    "RAS": (-1, -1, 1),
    "left-anterior-superior": (1, -1, 1),
}


def blob():
    """Return a map of 12 x 14 x 16 voxels with one of 2 x 2 x 2."""
    labels = np.zeros((12, 14, 16), np.uint8)
    labels[3:5, 4:6, 9:11] = 5
    return labels, np.array([3.5, 4.5, 9.5])


def middle_mm(found):
    places = np.argwhere(found.labels == 5).mean(axis=0)
    return 1e3 * (found.affine[:, :3] @ places + found.affine[:, 3])


def world_mm():
    return [AT["left"], AT["superior"], -AT["posterior"]]


def axes_of(turn):
    """Return oblique directions of axes, mm, as columns."""
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) * [1.0, 1.5, -2.5]


@pytest.mark.parametrize("space", SPACES)
def test_nrrd_voxels_lie_where_the_header_puts_them(tmp_path, space):
    labels, place = blob()
    directions = np.array(SPACES[space])[:, None] * axes_of(0.4)
    middle = np.array(SPACES[space]) * [AT["left"], AT["posterior"], AT["superior"]]
    header = {"space": space, "space directions": directions.T, "space origin": middle - directions @ place}
    nrrd.write(str(file := tmp_path / "map.nrrd"), labels, header)
    found = read_labels(file)
    assert middle_mm(found) == pytest.approx(world_mm())
    assert found.spacing == pytest.approx([1e-3, 1.5e-3, 2.5e-3])
    assert not found.notes


@pytest.mark.parametrize("unit", ["mm", "meter"])
@pytest.mark.parametrize("kind", [nibabel.Nifti1Image, nibabel.Nifti2Image])
def test_nifti_voxels_lie_where_the_header_puts_them(tmp_path, kind, unit):
    labels, place = blob()
    scale = 1.0 if unit == "mm" else 1e-3
    affine = np.eye(4)
    affine[:3, :3] = scale * np.diag([-1.0, -1.0, 1.0]) @ axes_of(-0.3)
    affine[:3, 3] = scale * np.array([-AT["left"], -AT["posterior"], AT["superior"]]) - affine[:3, :3] @ place
    image = kind(labels.astype(np.float32)[..., None], affine)
    image.header.set_xyzt_units(unit)
    nibabel.save(image, file := tmp_path / "map.nii.gz")
    assert middle_mm(read_labels(file)) == pytest.approx(world_mm(), abs=1e-4)


def test_what_the_header_leaves_out_is_said(tmp_path):
    labels, _ = blob()
    nrrd.write(str(file := tmp_path / "map.nrrd"), labels, {"spacings": [1.0, 2.0, 3.0]})
    found = read_labels(file)
    assert found.spacing == pytest.approx([1e-3, 2e-3, 3e-3])
    assert "no space says where left and up are" in found.notes[0]
    assert read_labels(file, unit=1e-2).spacing == pytest.approx([1e-2, 2e-2, 3e-2])


def segments(*rows):
    """Return the header's fields of segments: name, layer, value."""
    header = {}
    for i, (name, layer, value) in enumerate(rows):
        header |= {f"Segment{i}_ID": f"S{i}", f"Segment{i}_Name": name, f"Segment{i}_Layer": str(layer)}
        header[f"Segment{i}_LabelValue"] = str(value)
    return header


def test_segments_of_3d_slicer_have_names_and_may_overlap(tmp_path):
    one, _ = blob()
    nrrd.write(str(file := tmp_path / "one.seg.nrrd"), one, segments(("Liver", 0, 5)))
    assert read_labels(file).names == {"Liver": 5}
    layers = np.zeros((2, 8, 8, 8), np.uint8)
    layers[0, 1:7, 1:7, 1:7] = 1
    layers[1, 3:5, 3:5, 3:5] = 1
    header = segments(("Liver", 0, 1), ("Vessel", 1, 1)) | {
        "space": "LPS",
        "space directions": np.array([[np.nan] * 3, [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
        "space origin": np.zeros(3),
        "kinds": ["list", "domain", "domain", "domain"],
    }
    nrrd.write(str(file := tmp_path / "two.seg.nrrd"), layers, header)
    found = read_labels(file)
    assert found.names == {"Liver": 1, "Vessel": 2}
    assert np.bincount(found.labels.ravel()).tolist() == [0, 6**3 - 8, 8]
    assert "8 voxels are of several segments" in found.notes[0]


def test_labels_of_a_nifti_table_have_names(tmp_path):
    labels, _ = blob()
    table = "<CaretExtension><LabelTable><Label Key='5'>liver</Label></LabelTable></CaretExtension>"
    image = nibabel.Nifti1Image(labels, np.eye(4))
    image.header.extensions.append(nibabel.nifti1.Nifti1Extension(30, table.encode()))
    nibabel.save(image, file := tmp_path / "map.nii")
    assert read_labels(file).names == {"liver": 5}


HEADER = (
    "NRRD0005\ntype: {type}\ndimension: 3\nsizes: {sizes}\nencoding: {encoding}\nendian: little\n{more}\n"
)


def written(tmp_path, content=b"\1" * 64, **fields):
    given = {"type": "uint8", "sizes": "4 4 4", "encoding": "raw", "more": ""} | fields
    (file := tmp_path / "map.nrrd").write_bytes(HEADER.format(**given).encode() + content)
    return file


BAD_NRRD = {
    "as many voxels as in a year of scans": (
        {"sizes": "1000 1000 1000"},
        "1e\\+09 voxels of 1 bytes; at most",
    ),
    "more voxels than numbers": ({"sizes": "99999999999 99999999999 9"}, "at most"),
    "no voxels": ({"sizes": "4 0 4"}, "three axes"),
    "fewer voxels than stated": ({"sizes": "4 4 5"}, "fewer voxels than its header"),
    "another file": ({"more": "data file: ../../etc/passwd\n"}, "another file, which is not opened"),
    "a list of files": ({"more": "datafile: LIST\n"}, "another file, which is not opened"),
    "lines to skip": ({"more": "line skip: 1000000000000\n"}, "header skips"),
    "a negative spacing": ({"more": "spacings: -1 1 1\n"}, "positive numbers are needed"),
    "no number as spacing": ({"more": "spacings: nan 1 1\n"}, "positive numbers are needed"),
    "directions in a plane": (
        {"more": "space: LPS\nspace directions: (1,0,0) none (0,0,1)\n"},
        "three axes of space",
    ),
    "an endless origin": (
        {"more": "space: LPS\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (inf,0,0)\n"},
        "not finite",
    ),
    "two units": ({"more": 'space units: "mm" "cm" "mm"\n'}, "different units"),
    "an unknown encoding": ({"encoding": "zip"}, "encoding 'zip'"),
    "a picture": ({"type": "int8", "content": b"\xff" * 64}, "no map of labels"),
    "no whole numbers": ({"type": "float", "content": np.full(64, 0.5, "<f4").tobytes()}, "no map of labels"),
    "no numbers": ({"type": "float", "content": np.full(64, np.nan, "<f4").tobytes()}, "no map of labels"),
    "nothing": ({"content": bytes(64)}, "no label in it"),
    "a header without an end": ({"more": "x" * 2_000_000}, "header has no end"),
    "a bomb": (
        {"encoding": "gzip", "content": gzip.compress(bytes(10**8), 9)},
        "more voxels than its header",
    ),
    "another bomb": (
        {"encoding": "bzip2", "content": bz2.compress(bytes(10**7))},
        "more voxels than its header",
    ),
}


@pytest.mark.parametrize("case", BAD_NRRD)
def test_a_bad_nrrd_is_refused_with_the_reason(tmp_path, case):
    fields, reason = BAD_NRRD[case]
    with pytest.raises(ValueError, match=reason):
        parse_labels(written(tmp_path, **fields))


def nifti(tmp_path, **fields):
    image = nibabel.Nifti1Image(np.ones((4, 4, 4), np.uint8), np.eye(4))
    header = bytearray(image.header.binaryblock)
    struct = nibabel.Nifti1Header(bytes(header), check=False)
    for name, value in fields.items():
        struct[name] = value
    content = bytes(struct.binaryblock) + bytes(4) + b"\1" * 64
    (file := tmp_path / "map.nii").write_bytes(content)
    return file


BAD_NIFTI = {
    "as many voxels as in a year of scans": ({"dim": [3, 1000, 1000, 1000, 1, 1, 1, 1]}, "at most"),
    "negative sizes": ({"dim": [3, -4, 4, 4, 1, 1, 1, 1]}, "three axes"),
    "many axes": ({"dim": [5, 4, 4, 4, 3, 2, 1, 1]}, "three axes"),
    "a negative spacing": ({"pixdim": [1, -1, 1, 1, 0, 0, 0, 0]}, "positive numbers"),
    "no number as spacing": ({"pixdim": [1, np.nan, 1, 1, 0, 0, 0, 0]}, "positive numbers"),
    "voxels beyond the end": ({"vox_offset": 3e9}, "begin at byte"),
    "another file": ({"magic": b"ni1"}, "in another file"),
    "something else": ({"magic": b"jpg"}, "no NIfTI"),
}


@pytest.mark.parametrize("case", BAD_NIFTI)
def test_a_bad_nifti_is_refused_with_the_reason(tmp_path, case):
    fields, reason = BAD_NIFTI[case]
    with pytest.raises(ValueError, match=reason):
        parse_labels(nifti(tmp_path, **{"magic": b"n+1", "vox_offset": 352, **fields}))


@pytest.mark.parametrize("name", ["map.nrrd", "map.nii", "map.nii.gz"])
def test_a_file_of_something_else_is_refused_with_its_name(tmp_path, name):
    (file := tmp_path / name).write_bytes(zlib.compress(b"NRRD"))
    with pytest.raises(ValueError, match=re.escape(str(file))):
        read_labels(file)
    for content in (b"", b"\0" * 400, b"\x80\x04K\x01."):
        file.write_bytes(content)
        with pytest.raises((ValueError, StopIteration, OSError, EOFError, nrrd.NRRDError)):
            parse_labels(file)


def test_kinds_of_files_and_the_missing_package(tmp_path, monkeypatch):
    assert all(is_label_map(Path(name)) for name in ("A.NRRD", "a.seg.nrrd", "b.nii", "b.nii.gz"))
    assert not any(is_label_map(Path(name)) for name in ("a.stl", "b.gz", "nrrd", "a.nhdr"))
    monkeypatch.setattr(foreign_file, "find_spec", lambda _: None)
    with pytest.raises(MissingExtraError, match=r"pip install 'trocar\[meshes\]'"):
        read_labels(tmp_path / "map.nrrd")
