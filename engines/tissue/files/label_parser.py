"""Parses a label map in a process of its own: NRRD, segmentations of 3D Slicer, NIfTI.

`python -P -m engines.tissue.files.label_parser FILE RESULT` writes arrays. Headers are judged before voxels
are unpacked: a file states its size, and no more than the stated size is read. Nothing opens a second file.
"""

from __future__ import annotations

import bz2
import gzip
import io
import json
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import IO, Any, cast
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from engines.tissue.files.parser import limit_resources

__all__ = ["LABEL_SUFFIXES", "parse_labels"]

LABEL_SUFFIXES = (".nrrd", ".nii", ".nii.gz")

_MOST_VOXELS, _MOST_BYTES = 2**28, 2**30
"""Voxels and bytes of a map: a CT of 512 x 512 x 1000 fits."""
_MOST_KEPT = 10**8
"""Voxels of the box around all labels."""
_LONGEST_HEADER = 10**6
"""Bytes of a header with its names."""
_LAST_LABEL = 2**16 - 1

_TO_LPS = {
    "left-posterior-superior": (1.0, 1.0, 1.0),
    "lps": (1.0, 1.0, 1.0),
    "right-anterior-superior": (-1.0, -1.0, 1.0),
    "ras": (-1.0, -1.0, 1.0),
    "left-anterior-superior": (1.0, -1.0, 1.0),
    "las": (1.0, -1.0, 1.0),
}
"""Signs of a space's axes in the axes left, posterior, superior."""
_METRES = {"m": 1.0, "meter": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "micron": 1e-6}
_MILLIMETRES = 1e-3

Labels = NDArray[np.integer[Any]]
Affine = NDArray[np.float64]


def _parse_nrrd(file: IO[bytes]) -> dict[str, NDArray[Any]]:
    nrrd: Any = import_module("nrrd")
    start = file.read(_LONGEST_HEADER)
    ends = [at + len(mark) for mark in (b"\n\n", b"\r\n\r\n") if (at := start.find(mark)) >= 0]
    if not ends:
        raise ValueError("its header has no end: are its voxels in another file? Save both in one (.nrrd)")
    header: dict[str, Any] = nrrd.read_header(io.BytesIO(start[: min(ends)]))
    if {"data file", "datafile"} & header.keys():
        raise ValueError("its voxels are in another file, which is not opened: save both in one (.nrrd)")
    for skip in ("line skip", "lineskip", "byte skip", "byteskip"):
        if header.get(skip, 0) not in (0, -1):
            raise ValueError(f"its header skips ({skip}): save it anew without")
    sizes = [int(size) for size in header.get("sizes", ())]
    kind: Any = nrrd.reader._determine_datatype(header)
    _require_size(sizes, int(kind.itemsize))
    file.seek(min(ends))
    content = _unpack(file, str(header["encoding"]), int(np.prod(sizes)) * int(kind.itemsize))
    voxels = nrrd.read_data(
        header | {"encoding": "raw"} if content is not None else header,
        io.BytesIO(content) if content is not None else file,
    )
    affine, metres, notes = _nrrd_affine(header, len(sizes))
    space = [axis for axis in range(len(sizes)) if np.isfinite(_directions(header, len(sizes))[axis]).all()]
    layers = np.moveaxis(voxels, space, (-3, -2, -1)).reshape(-1, *np.array(sizes)[space])
    labels, names, more = _join_layers(_as_labels(layers), header)
    return _result(labels, affine, metres, names, [*notes, *more])


def _unpack(file: IO[bytes], encoding: str, size: int) -> bytes | None:
    """Return the voxels of a compressed file, `size` bytes; None: text, which pynrrd reads."""
    if encoding in ("raw", "gzip", "gz", "bzip2", "bz2"):
        unpacked: Any = file
        if encoding != "raw":
            unpacked = gzip.GzipFile(fileobj=file) if encoding.startswith("g") else bz2.BZ2File(file)
        content: bytes = unpacked.read(size + 1)
        if len(content) != size:
            more = "more" if len(content) > size else "fewer"
            raise ValueError(f"it holds {more} voxels than its header states")
        return content
    if encoding not in ("ascii", "ASCII", "text", "txt"):
        raise ValueError(f"encoding '{encoding}' is not read; raw, gzip, bzip2 or ascii are")
    return None


def _directions(header: Mapping[str, Any], count: int) -> Affine:
    """Return the step of each axis in space, shape (count, 3); NaN: an axis of layers."""
    if "space directions" in header:
        found = np.array(header["space directions"], np.float64)  # "none" is NaN
    else:
        spacings = np.array(header.get("spacings", np.ones(count)), np.float64)
        if spacings.shape != (count,) or not (spacings[-3:] > 0.0).all():
            raise ValueError(f"its spacings are {spacings.tolist()}: positive numbers are needed")
        found = np.full((count, 3), np.nan)
        found[-3:] = np.diag(spacings[-3:])
    if found.shape != (count, 3) or np.isfinite(found).all(axis=1).sum() != 3:
        raise ValueError(f"its directions are {found.tolist()}: three axes of space are needed")
    return found


def _nrrd_affine(header: Mapping[str, Any], count: int) -> tuple[Affine, float, list[str]]:
    """Return the map of voxels to axes left, posterior, superior, shape (3, 4), its unit (m), and notes."""
    directions, notes = _directions(header, count), list[str]()
    space = str(header.get("space", "")).lower().removesuffix("-time")
    if space not in _TO_LPS:
        stated = f"space '{space}' does not say" if space else "no space says"
        notes.append(f"{stated} where left and up are: taken as left-posterior-superior")
    signs = np.array(_TO_LPS.get(space, (1.0, 1.0, 1.0)))
    units = {str(unit).lower() for unit in header.get("space units", ())} & _METRES.keys()
    if len(units) > 1:
        raise ValueError(f"its axes have different units: {', '.join(sorted(units))}")
    metres = _METRES[units.pop()] if units else _MILLIMETRES
    origin = np.array(header.get("space origin", np.zeros(3)), np.float64)
    axes = directions[np.isfinite(directions).all(axis=1)].T
    return signs[:, None] * np.column_stack([axes, origin]), metres, notes


def _join_layers(layers: Labels, header: Mapping[str, Any]) -> tuple[Labels, dict[str, int], list[str]]:
    """Return one map of all layers, the numbers of its segments by name, and what was changed.

    Segments may overlap in layers: a voxel goes to the smallest.
    """
    segments: list[tuple[str, int, int]] = []
    for number in range(_LAST_LABEL):
        if f"Segment{number}_ID" not in header and f"Segment{number}_Name" not in header:
            break
        name = str(header.get(f"Segment{number}_Name") or header[f"Segment{number}_ID"])
        value = int(header.get(f"Segment{number}_LabelValue", 1 if len(layers) > 1 else number + 1))
        segments.append((name, int(header.get(f"Segment{number}_Layer", 0)), value))
    if len(layers) == 1:
        return layers[0], {name: value for name, _, value in segments}, []
    if not segments or any(not 0 <= layer < len(layers) for _, layer, _ in segments):
        raise ValueError(f"it has {len(layers)} layers and no segments that say what is in them")
    counts = [int((layers[layer] == value).sum()) for _, layer, value in segments]
    joined = np.zeros(layers.shape[1:], np.uint16)
    overlap = 0
    for i in sorted(range(len(segments)), key=lambda i: -counts[i]):
        inside = layers[segments[i][1]] == segments[i][2]
        overlap += int((joined[inside] > 0).sum())
        joined[inside] = i + 1
    notes = [f"{overlap} voxels are of several segments: they went to the smallest"] if overlap else []
    return joined, {name: i + 1 for i, (name, _, _) in enumerate(segments)}, notes


def _parse_nifti(file: IO[bytes]) -> dict[str, NDArray[Any]]:
    nibabel: Any = import_module("nibabel")
    start = file.read(4)
    is_second = 540 in (int.from_bytes(start, "little"), int.from_bytes(start, "big"))
    kind: Any = nibabel.Nifti2Header if is_second else nibabel.Nifti1Header
    size = int(kind.template_dtype.itemsize)
    start += file.read(size - 4)
    if len(start) < size:
        raise ValueError("it ends within its header")
    header: Any = kind(start, check=False)
    magic = bytes(header["magic"])
    if not magic.startswith(b"n+"):
        pair = magic.startswith(b"ni")
        raise ValueError("its voxels are in another file: save both in one (.nii)" if pair else "no NIfTI")
    shape = [int(size) for size in header["dim"][1 : 1 + max(0, min(7, int(header["dim"][0])))]]
    spacing = np.array(header["pixdim"][1:4], np.float64)
    if not (np.isfinite(spacing).all() and (spacing > 0.0).all()):
        raise ValueError(f"its spacings are {spacing.tolist()}: positive numbers are needed")
    while len(shape) > 3 and shape[-1] == 1:
        shape.pop()
    if len(shape) != 3:
        raise ValueError(f"it has the axes {shape}: one map of three axes is needed")
    _require_size(shape, int(header.get_data_dtype().itemsize))
    if not 0 <= float(header["vox_offset"]) <= _LONGEST_HEADER:
        raise ValueError(f"its voxels begin at byte {float(header['vox_offset']):g}")
    file.seek(0)
    image: Any = import_module("nibabel.nifti2" if is_second else "nibabel.nifti1")
    image = (image.Nifti2Image if is_second else image.Nifti1Image).from_stream(file)
    metres = _METRES.get(image.header.get_xyzt_units()[0], _MILLIMETRES)
    affine = np.diag([-1.0, -1.0, 1.0]) @ np.asarray(image.affine, np.float64)[:3]
    notes: list[str] = []
    if not (int(header["qform_code"]) or int(header["sform_code"])):
        notes.append("no form says where left and up are: taken as left-posterior-superior")
        affine[:2] *= -1.0
    labels = _as_labels(np.asanyarray(image.dataobj).reshape(shape))
    return _result(labels, affine, metres, _nifti_names(image.header.extensions), notes)


def _nifti_names(extensions: Any) -> dict[str, int]:
    """Return the numbers of labels by name from the table of Connectome Workbench, if there is one."""
    names: dict[str, int] = {}
    for extension in extensions:
        content = bytes(extension.content if extension.code == 30 else b"").rstrip(b"\0")
        if b"LabelTable" in content and b"<!DOCTYPE" not in content and b"<!ENTITY" not in content:
            for label in ElementTree.fromstring(content).iter("Label"):
                names[(label.text or "").strip()] = int(label.get("Key", "0"))
    return names


def _require_size(sizes: list[int], bytes_each: int) -> None:
    """Raise ValueError unless a map of these sizes can be read."""
    if not 3 <= len(sizes) <= 4 or min(sizes) < 1:
        raise ValueError(f"it has the sizes {sizes}: three axes of space are needed")
    count = 1
    for size in sizes:
        count *= size
    if count > _MOST_VOXELS or count * bytes_each > _MOST_BYTES:
        raise ValueError(
            f"its header states {count:.3g} voxels of {bytes_each} bytes; at most {_MOST_VOXELS:.3g} voxels"
            f" and {_MOST_BYTES // 2**20} MB are read: crop it to the organs, or resample it"
        )


def _as_labels(voxels: NDArray[Any]) -> Labels:
    """Return voxels as whole numbers. Raises ValueError for an image that is no map of labels."""
    if voxels.dtype.kind not in "iuf":
        raise ValueError(f"its voxels are of kind {voxels.dtype}, not numbers")
    if voxels.dtype.kind == "f" and not (np.isfinite(voxels).all() and (voxels == np.rint(voxels)).all()):
        raise ValueError(
            "its voxels are no whole numbers: it is a picture or a probability, no map of labels"
        )
    if voxels.min() < 0 or voxels.max() > _LAST_LABEL:
        raise ValueError(
            f"its voxels reach from {voxels.min():g} to {voxels.max():g}: it is a picture, no map of labels"
            f" (0 to {_LAST_LABEL})"
        )
    return voxels.astype(np.uint16)


def _result(
    labels: Labels, affine: Affine, metres: float, names: Mapping[str, int], notes: list[str]
) -> dict[str, NDArray[Any]]:
    """Return the box around all labels, with its affine, names and notes."""
    if not np.isfinite(affine).all():
        raise ValueError(f"its origin and directions are not finite: {affine.tolist()}")
    low, high = list[int](), list[int]()
    for axis in range(3):
        used = np.flatnonzero(labels.any(axis=tuple({0, 1, 2} - {axis})))
        if not len(used):
            raise ValueError("all its voxels are 0: there is no label in it")
        low.append(int(used[0]))
        high.append(int(used[-1]) + 1)
    ends = np.array([np.equal(low, 0), np.equal(high, labels.shape)])
    labels = labels[tuple(slice(a, b) for a, b in zip(low, high, strict=True))]
    if labels.size > _MOST_KEPT:
        raise ValueError(
            f"its labels fill a box of {labels.size:.3g} voxels; at most {_MOST_KEPT:.3g} are read: crop it"
            " to the organs, or resample it"
        )
    affine = np.column_stack([affine[:, :3], affine[:, 3] + affine[:, :3] @ np.array(low, np.float64)])
    return {
        "labels": labels,
        "affine": affine,
        "metres": np.array(metres),
        "ends": ends,
        "names": np.array(json.dumps(dict(names))),
        "notes": np.array(json.dumps(notes)),
    }


def parse_labels(file: Path) -> dict[str, NDArray[Any]]:
    """Return labels, affine, unit (m), ends, names and notes of a file.

    Raises ValueError, or any exception of the parsers.
    """
    name = file.name.lower()
    with file.open("rb") as content:
        if name.endswith(".nrrd"):
            return _parse_nrrd(content)
        if name.endswith(".gz"):
            with gzip.open(content) as unpacked:
                return _parse_nifti(cast("IO[bytes]", unpacked))
        return _parse_nifti(content)


if __name__ == "__main__":
    limit_resources()
    np.savez(Path(sys.argv[2]), allow_pickle=False, **parse_labels(Path(sys.argv[1])))
