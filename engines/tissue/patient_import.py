"""From a label map to the organs of one patient: meshes, surfaces where they touch, attachments."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from engines.tissue.files.label_file import LabelMap, read_labels
from engines.tissue.meshing.tet_mesh import TetMesh
from engines.tissue.organs.label_body import LabelBody, cut_out
from engines.tissue.organs.label_mesh import LabelMesh, mesh_body
from engines.tissue.organs.label_tube import LabelTube, trace_tube
from engines.tissue.organs.materials import preset, presets
from engines.tissue.organs.organ_file import OrganFile
from engines.tissue.organs.picks import NodePick, SurfacePick
from engines.tissue.organs.shape import ROUNDING_DIGITS, SIDES
from engines.tissue.organs.touching import Contact, join
from engines.tissue.patient_tube import PatientTube, make_tube
from schemas.errors import ScenarioError, did_you_mean
from schemas.files import file_hash
from schemas.keys import valid_name
from schemas.plain_sum import plain_sum
from schemas.vectors import Vector

__all__ = ["NODES", "ImportedPatient", "PatientOrgan", "import_patient"]

NODES = 1500
"""All organs together: half of what runs in real time (docs/decisions/0125-tissue-of-our-own.md)."""
_FEWEST = 60
_BY_VOLUME = 0.5
"""Power of the volume by which nodes are shared out: smaller organs get smaller edges."""
_COUNT_TOLERANCE = 0.15
"""Deviation of the number of nodes that is reported."""
_MOST_CARRIED, _GRAVITY = 500.0, 9.81
"""Weight over the area of attachments that an organ hangs on, Pa, a tenth of its modulus; gravity, m/s^2."""
_UNDERSIDE, _STEEP = "posterior", np.pi / 3.0
"""Surface that is held by default, and largest angle of its faces to -z, rad."""
_MATERIAL = "liver"
_MOST_ORGANS = 12
_LONGEST_NAME = 24
"""Two of them and `_on_` are the name of an attachment."""
_NO_NAME = re.compile(r"[^a-z0-9]+")


@dataclass
class PatientOrgan:
    """An organ of a label map, ready to write."""

    made: LabelMesh
    surfaces: dict[str, SurfacePick | NodePick] = field(default_factory=dict[str, SurfacePick | NodePick])
    anchors: tuple[str, ...] = ()
    material: str = _MATERIAL
    report: list[str] = field(default_factory=list[str])
    """Sentences: repairs and differences."""

    @property
    def name(self) -> str:
        """Name in scenarios."""
        return self.made.body.name

    @property
    def mesh(self) -> TetMesh:
        """The tetrahedra, m."""
        return self.made.mesh

    def file(self, source: Mapping[str, Any]) -> OrganFile:
        """Return the organ's file. `source`: file, unit and origin, the same for all organs."""
        return OrganFile(
            source={**source, "label": self.made.body.label, "report": list(self.report)},
            material=self.material,
            anchors=self.anchors,
            surfaces=self.surfaces,
            mesh=self.mesh.vtk_text,
        )


@dataclass(frozen=True)
class ImportedPatient:
    """Organs in one frame."""

    organs: dict[str, PatientOrgan]
    contacts: list[Contact]
    """Attachments: organs that touch."""
    tubes: list[PatientTube]
    """Ducts and vessels, hollow."""
    source: dict[str, Any]
    report: list[str]
    """Sentences about file and frame."""


def import_patient(
    path: Path,
    labels: Mapping[str, str],
    *,
    nodes: int = NODES,
    unit: float | None = None,
    keep_origin: bool = False,
    surfaces: Mapping[str, Mapping[str, SurfacePick]] | None = None,
    anchors: Mapping[str, Sequence[str]] | None = None,
    materials: Mapping[str, str] | None = None,
    tubes: Mapping[str, float] | None = None,
) -> ImportedPatient:
    """Return the organs of a label map.

    Args:
        path: NRRD, a segmentation of 3D Slicer, or NIfTI.
        labels: number, or name in the file, of each organ; none: all that the file names.
        nodes: about how many of all organs together.
        unit: unit of the file, m; None: as the file states.
        keep_origin: whether the origin stays that of the scan; else the middle of the top of all organs.
        surfaces: named parts of the surface, by organ.
        anchors: held surfaces by organ; default: the underside, unless larger organs carry the organ.
        materials: presets by organ; default: one of the organ's name, or liver.
        tubes: thickness of the wall (m) of ducts and vessels that become hollow tubes.

    Raises ScenarioError with the file, the reason and the remedy where there are no usable organs.
    """
    try:
        found = read_labels(path, unit)
        chosen = _choose(found, labels)
        _check_names(tubes or {}, list(chosen))
        for given in (surfaces, anchors, materials):
            _check_names(given or {}, [name for name in chosen if name not in (tubes or {})])
        shift = np.zeros(3) if keep_origin else _middle_of_top(found, list(chosen.values()))
        moved = np.column_stack([found.affine[:, :3], found.affine[:, 3] - shift])
        bodies = [cut_out(replace(found, affine=moved), name, label) for name, label in chosen.items()]
        lines = [trace_tube(body) for body in bodies if body.name in (tubes or {})]
        solid = [body for body in bodies if body.name not in (tubes or {})]
        organs, contacts = _make_organs(solid, lines, nodes)
        made = [organ.made for organ in organs.values()]
        hollow = [make_tube(line, (tubes or {})[line.body.name], made) for line in lines]
        for organ in organs.values():
            organ.surfaces |= (surfaces or {}).get(organ.name, {})
            organ.material = (materials or {}).get(organ.name) or _default_material(organ.name)
        _hold(organs, contacts, anchors or {})
    except ValueError as error:
        prefix = "" if str(error).startswith("mesh ") else f"mesh {path}: "
        raise ScenarioError(f"{prefix}{error}") from error
    source = {"files": {path.name: file_hash(path)}, "origin_m": shift.tolist()}
    return ImportedPatient(organs, contacts, hollow, source, [*found.notes, *_frame_sentences(found, shift)])


def _check_names(given: Mapping[str, Any], known: list[str]) -> None:
    """Raise ValueError for a name of no organ; tubes have neither surfaces nor materials to state."""
    for name in given:
        if name not in known:
            raise ValueError(f"there is no organ '{name}'.{did_you_mean(name, known)}")


def _choose(found: LabelMap, labels: Mapping[str, str]) -> dict[str, int]:
    """Return the label of each organ. Raises ValueError for labels that are not in the file."""
    numbers, counts = np.unique(found.labels[found.labels > 0], return_counts=True)
    volumes = dict(zip(numbers.tolist(), (1e6 * counts * np.prod(found.spacing)).tolist(), strict=True))
    named = {_as_name(name): number for name, number in found.names.items() if number in volumes}
    if not labels:
        if not 1 <= len(named) <= _MOST_ORGANS:
            raise ValueError(f"state --labels NAME=LABEL,... of {_list_labels(volumes, found.names)}")
        return named
    chosen: dict[str, int] = {}
    for name, stated in labels.items():
        number = int(stated) if stated.isdecimal() else named.get(_as_name(stated), 0)
        if number not in volumes:
            raise ValueError(
                f"it has no label '{stated}' for {name}; it has {_list_labels(volumes, found.names)}"
            )
        if not valid_name(name) or len(name) > _LONGEST_NAME:
            raise ValueError(
                f"'{name}' is no name: a letter, then letters, digits and underscores, {_LONGEST_NAME} at"
                " most"
            )
        chosen[name] = number
    if len(set(chosen.values())) < len(chosen):
        raise ValueError("two organs have the same label")
    return chosen


def _as_name(text: str) -> str:
    """Return a name for scenarios."""
    name = _NO_NAME.sub("_", text.lower()).strip("_")[:_LONGEST_NAME]
    return name if name[:1].isalpha() else f"organ_{name}"


def _list_labels(volumes: Mapping[int, float], names: Mapping[str, int]) -> str:
    by_number = {number: name for name, number in names.items()}
    shown = [
        f"{number} ({by_number[number] + ', ' if number in by_number else ''}{volume:.3g} ml)"
        for number, volume in sorted(volumes.items(), key=lambda pair: -pair[1])[:30]
    ]
    return ", ".join(shown) + (" ..." if len(volumes) > len(shown) else "")


def _default_material(name: str) -> str:
    """Return the preset of an organ's name, if there is one."""
    return name if name in presets() else _MATERIAL


def _middle_of_top(found: LabelMap, labels: list[int]) -> Vector:
    """Return the middle of the top (anterior) of the box around all these labels, m."""
    places = np.argwhere(np.isin(found.labels, labels)) @ found.affine[:, :3].T + found.affine[:, 3]
    low, high = places.min(axis=0), places.max(axis=0)
    x, y, _ = 0.5 * (low + high)
    return np.round(np.array([x, y, high[2]], np.float64), ROUNDING_DIGITS)


def _frame_sentences(found: LabelMap, shift: Vector) -> list[str]:
    edges = " x ".join(f"{1e3 * edge:.3g}" for edge in found.spacing.tolist())
    sentences = [f"voxels of {edges} mm; x to the patient's left, y cranial, z anterior"]
    if shift.any():
        middle = ", ".join(f"{1e3 * value:.4g}" for value in shift.tolist())
        sentences.append(
            f"origin: the middle of the top, ({middle}) mm in the scan; --keep-origin keeps its own"
        )
    return sentences


def _make_organs(
    bodies: list[LabelBody], lines: list[LabelTube], nodes: int
) -> tuple[dict[str, PatientOrgan], list[Contact]]:
    """Return the organs in the order of the bodies, joined where they touch."""
    weights = {body.name: body.field.raw_volume**_BY_VOLUME for body in bodies}
    wanted = {
        name: max(_FEWEST, round(nodes * weight / sum(weights.values()))) for name, weight in weights.items()
    }
    made: dict[str, LabelMesh] = {}
    for body in sorted(bodies, key=lambda body: body.field.raw_volume):
        made[body.name] = mesh_body(body, [*lines, *made.values()], wanted[body.name])
    contacts, missed = join(made)
    organs = {body.name: PatientOrgan(made[body.name]) for body in bodies}
    for organ in organs.values():
        organ.report += [*organ.made.body.changes, *_differences(organ.made, wanted[organ.name])]
    for name, other in missed:
        organs[name].report.append(
            f"its voxels touch {other}, its mesh does not: ask for more nodes, if it belongs there"
        )
    for contact in contacts:
        for name, facing, pick in zip(contact.organs, contact.organs[::-1], contact.picks, strict=True):
            organs[name].surfaces[f"to_{facing}"] = pick
    return organs, contacts


def _differences(made: LabelMesh, wanted: int) -> list[str]:
    """Return the differences of a mesh from the voxels as sentences."""
    volume, count = 1e6 * made.body.field.raw_volume, len(made.mesh.nodes)
    largest, usual = made.distances
    sentences = [
        f"volume {volume:.4g} ml in voxels, {100 * (made.volume_ratio - 1.0):+.1f} % in the mesh; surface"
        f" within {1e3 * usual:.2g} mm of the voxels' boundary (95 %), {1e3 * largest:.2g} mm at most"
    ]
    if abs(count / wanted - 1.0) > _COUNT_TOLERANCE:
        sentences.append(f"{count} nodes in place of {wanted}: the coarsest mesh without flaws near that")
    return sentences


def _hold(
    organs: Mapping[str, PatientOrgan], contacts: list[Contact], anchors: Mapping[str, Sequence[str]]
) -> None:
    """Anchor organs as stated, or at their underside if no larger ones carry them. Raises ValueError."""
    order = sorted(organs.values(), key=lambda organ: -organ.mesh.volume)
    for i, organ in enumerate(order):
        larger = {other.name for other in order[:i]}
        area = plain_sum(
            contact.area
            for contact in contacts
            if organ.name in contact.organs and larger & {*contact.organs}
        )
        weight = _GRAVITY * preset(organ.material).density * organ.mesh.volume
        if organ.name not in anchors and weight > _MOST_CARRIED * area:
            organ.surfaces.setdefault(_UNDERSIDE, SurfacePick(normal=(0.0, 0.0, -1.0), within=_STEEP))
            organ.anchors = (_UNDERSIDE,)
    for name, stated in anchors.items():
        organs[name].anchors = tuple(stated)
    for organ in organs.values():
        known = [*organ.surfaces, *SIDES]
        for surface in organ.anchors:
            if surface not in known:
                raise ValueError(f"{organ.name} has no surface '{surface}'.{did_you_mean(surface, known)}")
        for surface, pick in organ.surfaces.items():
            if not pick.nodes(organ.mesh).any():
                raise ValueError(f"surface '{organ.name}.{surface}' has no node")
