"""The command `trocar organs`: organs and materials, and organs of files of other programs.

Stands above the engines, as the list knows Bullet and the pictures are MuJoCo's.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from engines.bullet.command_line import list_organs
from schemas.errors import TrocarError

if TYPE_CHECKING:
    from engines.tissue.organ_import import ImportedOrgan
    from engines.tissue.organs.picks import SurfacePick

__all__ = ["app"]

app = typer.Typer(help="Shapes and materials of organs; organs of your own.")
app.callback(invoke_without_command=True)(list_organs)

_PICK = "bed={normal: -z}"


@app.command("import")
def import_files(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...",
            help=(
                "Surfaces (.stl, .obj, .ply, .glb, .gltf), taken together, or one file of tetrahedra (.vtk,"
                " .vtu, .msh, .med), or one label map of several organs (.nrrd, .seg.nrrd, .nii, .nii.gz)."
            ),
        ),
    ],
    *,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="ORGAN.YAML",
            help="File for scenarios (mesh: ...); of a label map a scenario, its organs beside it.",
        ),
    ],
    labels: Annotated[
        str | None,
        typer.Option(
            metavar="NAME=LABEL,...",
            help=(
                "Organs of a label map, such as 'liver=1,gallbladder=2'; a label may be a segment's name."
                " Default: all segments with a name."
            ),
        ),
    ] = None,
    nodes: Annotated[
        int | None,
        typer.Option(
            min=18,
            max=5000,
            help=(
                "About how many; default: 250 in a surface, those of a file of tetrahedra, 1500 in all"
                " organs of a label map."
            ),
        ),
    ] = None,
    unit: Annotated[
        str | None, typer.Option(metavar="[m|cm|mm]", help="Of the files; default: as stated, or guessed.")
    ] = None,
    surface: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=PICK",
            help=(
                f"Name a part of the surface by normal, box or plane, such as '{_PICK}',"
                " 'hilum={box: {low: [0, -10 mm, -5 mm], high: [9 mm, 10 mm, 0]}}' or"
                " 'dome={plane: {point: [0, 0, -5 mm], towards: +z}}'. Of a label map: ORGAN.NAME=PICK."
                " May be repeated."
            ),
        ),
    ] = None,
    anchor: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help=(
                "Surface that is held; default: bottom. Of a label map: ORGAN.NAME; default: the"
                " underside of what larger organs do not carry. May be repeated."
            ),
        ),
    ] = None,
    material: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Default material; `trocar organs` lists them. Of a label map: ORGAN=NAME, may be repeated.",
        ),
    ] = None,
    tube: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ORGAN=WALL",
            help=(
                "Duct or vessel of a label map that becomes a hollow tube with a wall of this thickness,"
                " such as 'cystic_duct=1 mm'. May be repeated."
            ),
        ),
    ] = None,
    part: Annotated[
        int | None, typer.Option(min=1, help="Which part of a body in several, 1 for the largest.")
    ] = None,
    keep_origin: Annotated[
        bool, typer.Option("--keep-origin", help="Leave the origin of the files where it is.")
    ] = False,
) -> None:
    """Make an organ of your own of a surface or of tetrahedra, with a picture beside it."""
    from engines.tissue.files.label_file import is_label_map
    from engines.tissue.organ_import import FACTORS, import_organ
    from schemas.user_files import require_place

    require_place(output)
    if output.suffix.lower() not in (".yaml", ".yml"):
        raise typer.BadParameter(f"'{output}' is not a .yaml file", param_hint="--output")
    if unit not in (None, "m", "cm", "mm"):
        raise typer.BadParameter(f"'{unit}' is none of m, cm, mm", param_hint="--unit")
    picks, materials = _parse_picks(surface or []), material or []
    _check_materials(materials)
    if any(is_label_map(file) for file in files):
        if len(files) > 1 or part is not None:
            raise typer.BadParameter("a label map is one file, without --part", param_hint="FILE")
        from engines.patient_command import import_labels, parse_labels

        typer.echo(
            import_labels(
                files[0],
                output,
                parse_labels(labels or ""),
                nodes=nodes,
                unit=None if unit is None else FACTORS[unit],
                keep_origin=keep_origin,
                surfaces=picks,
                anchors=anchor or [],
                materials=materials,
                tubes=_parse_tubes(tube or []),
            )
        )
        return
    if labels or tube or len(materials) > 1:
        raise typer.BadParameter(
            "--labels, --tube and several materials are of a label map", param_hint="FILE"
        )
    organ = import_organ(
        files,
        nodes=nodes,
        unit=unit,
        part=part,
        keep_origin=keep_origin,
        surfaces=picks,
        anchors=anchor or ["bottom"],
        material=materials[0] if materials else None,
    )
    output.write_text(organ.file.text(), encoding="utf-8")
    typer.echo(_summary(organ, output))


@app.command("example")
def write_example_patient(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Label map to write (.nrrd, .nii, .nii.gz).")],
    *,
    seed: Annotated[int, typer.Option(min=0, help="Of the surfaces' noise.")] = 7,
) -> None:
    """Write a label map of liver, gallbladder and cystic duct of no real patient."""
    from engines.tissue.example_patient import LABELS, write_example
    from schemas.user_files import require_place

    require_place(file)
    write_example(file, seed)
    typer.echo(f"wrote {file}: {', '.join(f'{name}={label}' for name, label in LABELS.items())}")


def _parse_tubes(texts: list[str]) -> dict[str, float]:
    from pydantic import TypeAdapter, ValidationError

    from engines.tissue.organs.tube import Wall

    tubes: dict[str, float] = {}
    for text in texts:
        name, _, wall = text.partition("=")
        try:
            tubes[name] = TypeAdapter[float](Wall).validate_python(wall)
        except ValidationError:
            raise typer.BadParameter(
                f"'{text}' is not ORGAN=WALL, such as 'cystic_duct=1 mm'", param_hint="--tube"
            ) from None
    return tubes


def _check_materials(materials: list[str]) -> None:
    from engines.tissue.organs.materials import preset

    for name in materials:
        try:
            preset(name.rpartition("=")[2])
        except ValueError as error:
            raise typer.BadParameter(str(error), param_hint="--material") from None


def _parse_picks(texts: list[str]) -> Mapping[str, SurfacePick]:
    from pydantic import TypeAdapter, ValidationError
    from ruamel.yaml import YAML, YAMLError

    from engines.tissue.organs.picks import SurfacePick
    from schemas.scenario import Name

    picks: dict[str, SurfacePick] = {}
    yaml: Any = YAML(typ="safe")
    for text in texts:
        name, _, pick = text.partition("=")
        try:
            for one in name.split(".", 1):
                TypeAdapter[str](Name).validate_python(one)
            picks[name] = SurfacePick.model_validate(yaml.load(pick))
            if picks[name].is_empty:
                raise typer.BadParameter(f"'{text}' picks nothing; such as '{_PICK}'", param_hint="--surface")
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            where = ".".join(map(str, first["loc"]))
            raise typer.BadParameter(
                f"'{text}': {where}: {first['msg']}; such as '{_PICK}'", param_hint="--surface"
            ) from None
        except YAMLError:
            raise typer.BadParameter(
                f"'{text}' is not NAME=PICK, such as '{_PICK}'", param_hint="--surface"
            ) from None
    return picks


def _summary(organ: ImportedOrgan, output: Path) -> str:
    """Return the result as text: numbers, changes, files, next steps."""
    import numpy as np

    from engines.tissue.meshing.tet_mesh import shape_quality

    mesh = organ.mesh
    size = " x ".join(f"{1e3 * edge:.4g}" for edge in np.ptp(mesh.nodes, axis=0).tolist())
    quality = float(shape_quality(mesh.nodes, mesh.tetrahedra).min())
    material = organ.file.material or "liver"
    lines = [
        f"{output.stem}: {len(mesh.nodes)} nodes, {len(mesh.tetrahedra)} tetrahedra, {size} mm,"
        f" {1e6 * mesh.volume:.4g} ml, least shape quality {quality:.2f} (1 is regular)",
        *(f"  {line}" for line in organ.report),
        f"  held at {', '.join(organ.file.anchors)}; --anchor NAME changes that",
        f"wrote {output}",
        _draw(organ, output),
        "in a scenario:",
        f"  organs: {{{output.stem}: {{mesh: {output.name}, material: {material}}}}}",
    ]
    return "\n".join(lines)


def _draw(organ: ImportedOrgan, output: Path) -> str:
    """Write the picture, and return a line about it."""
    if find_spec("mujoco") is None or find_spec("PIL") is None:
        return "no picture: pip install 'trocar[mujoco]' draws one"
    from engines.mujoco.pictures.mesh_picture import draw_mesh
    from engines.tissue.organs.params import OrganParams
    from schemas.files import Files

    anchors = [{"surface": name} for name in organ.file.anchors]
    params = OrganParams.model_validate(
        {"mesh": output.name, "young_modulus": 1e4, "anchors": anchors},
        context=Files(output.parent.resolve()).context,
    )
    picks = organ.file.surfaces
    free = picks.keys() - set(organ.file.anchors)
    surfaces = {name: picks[name].nodes(organ.mesh) for name in picks if name in free}
    for anchor in params.anchors or ():
        surfaces[f"{anchor.surface} (held)"] = params.surface(anchor)
    picture = output.with_suffix(".png")
    title = f"{output.stem}, {len(organ.mesh.nodes)} nodes"
    try:
        draw_mesh(picture, organ.mesh.nodes, organ.mesh.triangles, surfaces, title)
    except TrocarError as error:
        return f"no picture: {error}"
    return f"wrote {picture}"
