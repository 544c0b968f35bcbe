"""The list of `trocar organs`: shapes and materials for scenarios, with their sources."""

from __future__ import annotations

import json
from dataclasses import asdict
from textwrap import fill
from typing import Annotated, Any

import typer

__all__ = ["list_organs"]

_WIDTH = 120
_RADII_M = (2e-3, 5e-3)
"""Radii of the spheres in the table of contacts."""
_LIMITS = (
    "What is mended is within 10 percent of converged finite elements for spheres of 2 to 5 mm on blocks, and"
    " of 5 mm on liver and kidney; nearer than 1.6 radii to a rim it is up to a quarter too stiff (decision"
    " 95).",
    "Probes of several spheres and fingers feel the mesh. Tissue that is held, as by jaws 4 mm wide, is 2 to"
    " 5.5 times too stiff with 250 nodes, 1.3 to 3.4 times with 600.",
    "Bullet's tissue does not relax. Its damping is in proportion to its stiffness: with 1 ms its loss"
    " tangent is 0.001 at 0.1 Hz and 0.007 at 1 Hz; tissue that relaxed in a press has 0.16 and 0.10.",
)
"""Limits of all materials."""


def list_organs(
    context: typer.Context,
    *,
    nodes: Annotated[
        int, typer.Option(min=18, max=5000, help="About how many nodes the meshes shall have.")
    ] = 250,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")] = False,
) -> None:
    """Print the organs and the materials for scenarios.

    Organs come with surfaces and meshes, materials with sources; SI units. `import` makes one of files.
    """
    if context.invoked_subcommand:
        return
    found = {"shapes": _shapes(nodes), "materials": _material_rows()}
    typer.echo(json.dumps(found, indent=2) if as_json else _text(found))


def _shapes(nodes: int) -> dict[str, Any]:
    import numpy as np

    from engines.tissue.meshing.tet_mesh import dihedral_angles, shape_quality
    from engines.tissue.organs.catalogue import SHAPES

    shapes: dict[str, Any] = {}
    for name, shape in SHAPES.items():
        mesh = shape.mesh(nodes)
        angles = np.degrees(dihedral_angles(mesh.nodes, mesh.tetrahedra))
        shapes[name] = {
            "description": shape.description,
            "surfaces": shape.names,
            "anchored": shape.anchors,
            "material": shape.material,
            "nodes": len(mesh.nodes),
            "tetrahedra": len(mesh.tetrahedra),
            "volume": mesh.volume,
            "extent": np.ptp(mesh.nodes, axis=0).tolist(),
            "dihedral_angles_deg": [float(angles.min()), float(angles.max())],
            "least_shape_quality": float(shape_quality(mesh.nodes, mesh.tetrahedra).min()),
            "contact": _contact(name, nodes),
        }
    return shapes


def _contact(shape: str, nodes: int) -> list[dict[str, Any]]:
    """Return the error of the mesh under spheres of `_RADII_M`; empty: no correction."""
    from engines.bullet.probes.band import band
    from engines.tissue.organs.params import OrganParams

    organ = OrganParams.model_validate({"shape": shape, "nodes": nodes})
    found = [band(organ, radius) for radius in _RADII_M]
    return [{**asdict(one), "text": str(one)} for one in found if one is not None]


def _material_rows() -> dict[str, Any]:
    from engines.tissue.organs.materials import presets

    return {name: preset.model_dump() for name, preset in presets().items()}


def _text(found: dict[str, Any]) -> str:
    lines = ["Shapes (shape: ...)"]
    for name, shape in found["shapes"].items():
        low, high = shape["dihedral_angles_deg"]
        lines += ["", f"  {name}", _wrapped(shape["description"])]
        lines += [
            _wrapped(
                f"surfaces {', '.join(shape['surfaces'])}; anchored {', '.join(shape['anchored'])}; material"
                f" {shape['material']}"
            )
        ]
        lines += [
            _wrapped(
                f"mesh {shape['nodes']} nodes, {shape['tetrahedra']} tetrahedra, dihedral angles {low:.0f} to"
                f" {high:.0f} deg"
            )
        ]
        contact = [one["text"] for one in shape["contact"]] or ["that of the mesh: too many nodes to mend it"]
        lines += [_wrapped(f"force of the mesh: {text}") for text in contact]
    lines += ["", *(_wrapped(text) for text in _LIMITS)]
    lines += ["", "Materials (material: ...)"]
    for name, preset in found["materials"].items():
        numbers = (
            f"E {preset['young_modulus']:g} Pa, Poisson ratio {preset['poisson_ratio']:g}, density"
            f" {preset['density']:g} kg/m^3"
        )
        lines += [
            "",
            f"  {name}",
            _wrapped(numbers),
            _wrapped(f"loading: {preset['loading']}"),
            _wrapped(f"source: {preset['source']}"),
        ]
    return "\n".join(lines)


def _wrapped(text: str) -> str:
    return fill(text, _WIDTH, initial_indent="    ", subsequent_indent="      ")
