"""The command `trocar instruments`: the instruments of a PSM, and fingers of a model of the user's own."""

from __future__ import annotations

from math import radians
from pathlib import Path
from typing import Annotated

import typer

from robots.dvrk.instruments import instruments

__all__ = ["app"]

app = typer.Typer(help="Instruments of a PSM; a jaw of your own.")


@app.callback(invoke_without_command=True)
def list_instruments(context: typer.Context) -> None:
    """Print the instruments by name, with their end effectors."""
    if context.invoked_subcommand is not None:
        return
    known = [one for one in instruments().values() if not one.has_snake_wrist]
    width = max(len(one.name) for one in known)
    for one in sorted(known, key=lambda one: one.name):
        what = (
            type(one.end_effector).__name__.lower()
            if one.jaw is None
            else f"jaw of {1e3 * one.jaw.length:.3g} mm"
        )
        typer.echo(f"{one.name:{width}}  {what}")
    typer.echo(
        "\ntrocar instruments import FILE -o tip.yaml   # fingers of your own, from a URDF or MJCF model"
    )


@app.command("import")
def import_file(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Model with a jaw of two fingers: .urdf, or MJCF (.xml); a whole arm may be around it.",
        ),
    ],
    *,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="TIP.YAML", help="File for scenarios (tip: ...).")
    ],
    fingers: Annotated[
        str | None,
        typer.Option(metavar="LEFT,RIGHT", help="Links of the fingers; default: the only pair on one hinge."),
    ] = None,
    opening: Annotated[
        float | None,
        typer.Option(min=1.0, max=180.0, help="Largest angle, degrees; default: by the joints' ranges."),
    ] = None,
    scale: Annotated[float, typer.Option(min=1e-6, max=1e3, help="Metres per unit of the model.")] = 1.0,
) -> None:
    """Make a jaw of your own of two links of a URDF or MJCF model."""
    from engines.mujoco.tip_import import import_tip
    from schemas.user_files import require_place

    require_place(output)
    if output.suffix.lower() not in (".yaml", ".yml"):
        raise typer.BadParameter(f"'{output}' is not a .yaml file", param_hint="--output")
    links = [] if fingers is None else fingers.replace(",", " ").split()
    if fingers is not None and len(links) != 2:
        raise typer.BadParameter(f"'{fingers}' is not LEFT,RIGHT", param_hint="--fingers")
    name = "".join(letter if letter.isalnum() else "_" for letter in output.stem)
    tip = import_tip(
        file, name=name, fingers=links, opening=None if opening is None else radians(opening), scale=scale
    )
    output.write_text(tip.file.text(), encoding="utf-8")
    typer.echo(f"{name}: {len(tip.file.left.triangles[1])} and {len(tip.file.right.triangles[1])} faces")
    for line in tip.report:
        typer.echo(f"  {line}")
    typer.echo(f"wrote {output}\n\nin a scenario, on the shaft and wrist of an instrument with a jaw:\n")
    typer.echo(f'  arms: {{PSM1: {{instrument: "400006", tip: {output}}}}}')
