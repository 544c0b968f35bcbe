"""The command `trocar organs`: the shapes and materials that a scenario may name, with their sources."""

from __future__ import annotations

import json
from textwrap import fill
from typing import Annotated, Any

import typer

__all__ = ["app"]

app = typer.Typer(help="Shapes and materials of organs.")

_WIDTH = 120


@app.command()
def organs(
    *,
    nodes: Annotated[
        int, typer.Option(min=18, max=5000, help="About how many nodes the meshes shall have.")
    ] = 250,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")] = False,
) -> None:
    """Print the organs and the materials that a scenario may name.

    Organs come with their surfaces and meshes, materials with their sources; SI units.
    """
    found = {"shapes": _shapes(nodes), "materials": _materials()}
    typer.echo(json.dumps(found, indent=2) if as_json else _text(found))


def _shapes(nodes: int) -> dict[str, Any]:
    import numpy as np

    from engines.bullet.meshing.tet_mesh import dihedral_angles, shape_quality
    from engines.bullet.organs.catalogue import SHAPES

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
        }
    return shapes


def _materials() -> dict[str, Any]:
    from engines.bullet.organs.materials import presets

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
