"""Writes the organs of a label map: a file for each, a scenario that runs them, pictures, a report."""

from __future__ import annotations

import re
import time
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from schemas.errors import TrocarError

if TYPE_CHECKING:
    from engines.fem.params import FemParams
    from engines.tissue.organs.picks import SurfacePick
    from engines.tissue.patient_import import ImportedPatient, PatientOrgan

__all__ = ["import_labels", "parse_labels"]

_TUBES = re.compile(r"duct|artery|vein|vessel|ureter|aorta|urethra")
_GROWN = {"strength": "1 MPa", "toughness": "1 kJ/m^2"}
"""Attachment of a tube to its organ (docs/decisions/0142-attachments.md)."""
_MS = 1_000_000
_TIMED_STEPS = 20


def parse_labels(text: str) -> dict[str, str]:
    """Return label or name in the file by organ, of text such as `liver=1,gallbladder=2`."""
    pairs = (part.partition("=") for part in text.split(",") if part.strip())
    return {name.strip(): (label or name).strip() for name, _, label in pairs}


def import_labels(
    file: Path,
    output: Path,
    labels: Mapping[str, str],
    *,
    nodes: int | None,
    unit: float | None,
    keep_origin: bool,
    surfaces: Mapping[str, SurfacePick],
    anchors: Sequence[str],
    materials: Sequence[str],
    tubes: Mapping[str, float],
) -> str:
    """Write organs and scenario, and return the report. Surfaces and anchors are `organ.name`."""
    from engines.tissue.patient_import import NODES, import_patient

    picks: dict[str, dict[str, SurfacePick]] = {}
    for name, pick in surfaces.items():
        organ, surface = _split(name, "--surface")
        picks.setdefault(organ, {})[surface] = pick
    held: dict[str, list[str]] = {}
    for name in anchors:
        organ, surface = _split(name, "--anchor")
        held.setdefault(organ, []).append(surface)
    patient = import_patient(
        file,
        labels,
        nodes=nodes or NODES,
        unit=unit,
        keep_origin=keep_origin,
        surfaces=picks,
        anchors=held,
        materials=dict(one.split("=", 1) for one in materials),
        tubes=tubes,
    )
    names = {name: output.with_name(f"{output.stem}-{name}.yaml") for name in patient.organs}
    for name, organ in patient.organs.items():
        names[name].write_text(organ.file(patient.source).text(), encoding="utf-8")
    output.write_text(_scenario(patient, file, output), encoding="utf-8")
    return "\n".join(_lines(patient, output, names))


def _split(name: str, option: str) -> tuple[str, str]:
    import typer

    organ, dot, surface = name.partition(".")
    if not dot:
        raise typer.BadParameter(
            f"'{name}' is not ORGAN.SURFACE: a label map has several organs", param_hint=option
        )
    return organ, surface


def _tissue(patient: ImportedPatient, stem: str) -> dict[str, Any]:
    """Return the tissue of a scenario."""
    organs: dict[str, Any] = {
        name: {"mesh": f"{stem}-{name}.yaml", "anchors": [{"surface": one} for one in organ.anchors]}
        for name, organ in patient.organs.items()
    }
    organs |= {tube.name: tube.params for tube in patient.tubes}
    attachments: dict[str, Any] = {}
    for contact in patient.contacts:
        first, second = contact.organs
        grown = _GROWN if _TUBES.search(first) or _TUBES.search(second) else {}
        attachments[f"{first}_on_{second}"] = {
            "organs": [first, second],
            "surface": f"to_{second}",
            "within": f"{1e3 * contact.within:.2f} mm",
            **grown,
        }
    for tube in patient.tubes:
        for joint in tube.joints:
            attachments[f"{tube.name}_on_{joint.organ}"] = {
                "organs": [tube.name, joint.organ],
                "surface": joint.end,
                "within": f"{1e3 * joint.within:.2f} mm",
                **_GROWN,
            }
    return {"kind": "fem", "organs": organs, "attachments": attachments}


def _scenario(patient: ImportedPatient, file: Path, output: Path) -> str:
    """Return a scenario of the organs alone, which settle under their weight."""
    from ruamel.yaml import YAML

    tissue = _tissue(patient, output.stem)
    content = {
        "name": re.sub(r"[^a-z0-9]+", "-", output.stem.lower()).strip("-") or "patient",
        "description": f"Organs of {file.name}: x to the patient's left, y cranial, z anterior.",
        "step": "1 ms",
        "duration": "200 ms",
        "participants": {"tissue": tissue},
        "order": ["tissue"],
        "measure": {
            f"{name}_n": {"kind": "peak-norm", "of": f"tissue.{name}/force", "unit": "N"}
            for name in tissue["attachments"]
        },
    }
    stream, yaml = StringIO(), cast("Any", YAML())
    yaml.width = 110
    yaml.dump(content, stream)
    return (
        "# Written by `trocar organs import`. Attachments have the strength of connective tissue (assumed),"
        " or of a duct\n# or a vessel on its organ, where a name says so (decision 142).\n"
        + stream.getvalue()
    )


def _lines(patient: ImportedPatient, output: Path, names: Mapping[str, Path]) -> list[str]:
    lines = [*patient.report]
    for organ in patient.organs.values():
        lines += [_organ_line(organ), *(f"  {line}" for line in organ.report)]
        lines.append(f"  {organ.material}; held at {', '.join(organ.anchors) or 'nothing but other organs'}")
    for tube in patient.tubes:
        lines += [f"{tube.name}: {len(tube.mesh.nodes)} nodes", *(f"  {line}" for line in tube.report)]
    for contact in patient.contacts:
        first, second = contact.organs
        lines.append(
            f"{first} touches {second} over {1e6 * contact.area:.0f} mm^2: surfaces '{first}.to_{second}' and"
            f" '{second}.to_{first}'; nodes of the first moved by {1e3 * contact.moved:.2g} mm at most, onto"
            " the second, and are attached"
        )
    lines += [f"wrote {path}" for path in names.values()]
    lines += [
        f"wrote {output}",
        _draw(patient, output),
        _cost(output, patient),
        f"run it: trocar run {output.name}",
    ]
    return lines


def _organ_line(organ: PatientOrgan) -> str:
    from engines.tissue.meshing.tet_mesh import shape_quality

    mesh = organ.mesh
    size = " x ".join(f"{1e3 * edge:.4g}" for edge in np.ptp(mesh.nodes, axis=0).tolist())
    quality = float(shape_quality(mesh.nodes, mesh.tetrahedra).min())
    return (
        f"{organ.name}: {len(mesh.nodes)} nodes, {len(mesh.tetrahedra)} tetrahedra, {size} mm, least shape"
        f" quality {quality:.2f} (1 is regular)"
    )


def _cost(output: Path, patient: ImportedPatient) -> str:
    """Return what a step costs on this machine, by running some."""
    from engines.fem.engine import FemEngine
    from engines.fem.params import FemParams
    from hub.participant import Inputs, Setup
    from schemas.files import Files

    tissue = {name: value for name, value in _tissue(patient, output.stem).items() if name != "kind"}
    params: FemParams = FemParams.model_validate(tissue, context=Files(output.parent.resolve()).context)
    with FemEngine("tissue", params) as engine:
        engine.configure(Setup(_MS, output.parent, {}))
        times: list[float] = []
        for k in range(_TIMED_STEPS):
            begun = time.perf_counter()
            engine.step(k * _MS, _MS, Inputs({}))
            times.append(time.perf_counter() - begun)
    took = float(np.median(times))
    nodes = sum(len(organ.mesh.nodes) for organ in (*patient.organs.values(), *patient.tubes))
    fits = f"some {int(nodes * 1e-3 / took / 100) * 100} nodes" if took < 2e-3 else "fewer nodes"
    return (
        f"a step of 1 ms takes {1e3 * took:.2g} ms here, alone, with {nodes} nodes: {fits} of this size fit"
        " real time"
    )


def _draw(patient: ImportedPatient, output: Path) -> str:
    """Write a picture of all organs and one of each with its surfaces; return a line about them."""
    if find_spec("mujoco") is None or find_spec("PIL") is None:
        return "no picture: pip install 'trocar[mujoco]' draws one"
    from engines.mujoco.pictures.mesh_picture import draw_mesh

    organs = [*patient.organs.values(), *patient.tubes]
    starts = np.cumsum([0, *(len(organ.mesh.nodes) for organ in organs)])
    numbers = np.arange(int(starts[-1]))
    pictures = [output.with_suffix(".png")]
    try:
        draw_mesh(
            pictures[0],
            np.concatenate([organ.mesh.nodes for organ in organs]),
            np.concatenate(
                [organ.mesh.triangles + start for organ, start in zip(organs, starts, strict=False)]
            ),
            {
                organ.name: (numbers >= start) & (numbers < start + len(organ.mesh.nodes))
                for organ, start in zip(organs, starts, strict=False)
            },
            f"{output.stem}, {int(starts[-1])} nodes",
        )
        for organ in patient.organs.values():
            pictures.append(output.with_name(f"{output.stem}-{organ.name}.png"))
            surfaces = {name: pick.nodes(organ.mesh) for name, pick in organ.surfaces.items()}
            title = f"{organ.name}, {len(organ.mesh.nodes)} nodes"
            draw_mesh(pictures[-1], organ.mesh.nodes, organ.mesh.triangles, surfaces, title)
    except TrocarError as error:
        return f"no picture: {error}"
    return "wrote " + ", ".join(map(str, pictures))
