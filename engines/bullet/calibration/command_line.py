"""The commands `trocar calibrate`: a material file from measurements."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from schemas.errors import MissingExtraError
from schemas.quantity import to_si
from schemas.user_files import require_place

if TYPE_CHECKING:
    from engines.bullet.calibration.fit import Calibration

__all__ = ["app"]

_LARGE_RESIDUAL = 0.1
"""Residual of the force above which a fit is warned of."""

app = typer.Typer(help="Materials from your own measurements.", no_args_is_help=True)


def _quantity_parser(unit: str) -> Any:
    """Return the parser of an option such as `5 mm`, as a float in `unit`."""

    def parse(text: str | float) -> float:
        try:
            return to_si(text, unit)
        except ValueError as error:
            raise typer.BadParameter(str(error)) from error

    return parse


@app.callback()
def calibrate() -> None:
    """Fit materials to your own measurements."""


@app.command()
def tissue(
    data: Annotated[
        Path,
        typer.Argument(
            metavar="DATA.csv",
            exists=True,
            dir_okay=False,
            help="Columns time (s), depth (m), force (N); for friction also slide (m), tangential_force (N).",
        ),
    ],
    *,
    shape: Annotated[str, typer.Option(help="Of the indenter: sphere, or punch, which is flat and round.")],
    radius: Annotated[
        float, typer.Option(parser=_quantity_parser("m"), metavar="LENGTH", help="Such as '5 mm'.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The file for the scenario, .yaml.")
    ],
    thickness: Annotated[
        float | None,
        typer.Option(
            parser=_quantity_parser("m"),
            metavar="LENGTH",
            help="Of a layer bonded to something rigid, under a sphere; thick unless given.",
        ),
    ] = None,
    poisson_ratio: Annotated[
        float, typer.Option(min=0.01, max=0.495, help="An indenter cannot measure it.")
    ] = 0.4,
    density: Annotated[
        float,
        typer.Option(
            parser=_quantity_parser("kg/m^3"), metavar="DENSITY", help="An indenter cannot measure it."
        ),
    ] = 1000.0,
    two_parameters: Annotated[
        bool, typer.Option("--two-parameters", help="Fit a stiffening beside the neo-Hookean modulus.")
    ] = False,
    frequency: Annotated[
        float, typer.Option(min=0.001, max=1000.0, help="Hz, for which the scenario's material stands.")
    ] = 1.0,
) -> None:
    """Fit modulus, stress relaxation and friction to the force of an indenter, with their deviations."""
    if find_spec("scipy") is None:
        raise MissingExtraError("'trocar calibrate tissue'", "identify", "scipy")
    from engines.bullet.calibration.fit import calibrate as fit
    from engines.bullet.calibration.indentation import SHAPES, Indenter
    from engines.bullet.calibration.measurements import read
    from engines.bullet.calibration.result import material_file

    if shape not in SHAPES:
        raise typer.BadParameter(f"'{shape}' is none of {', '.join(SHAPES)}", param_hint="--shape")
    if two_parameters and shape != "sphere":
        raise typer.BadParameter("a stiffening is known for a sphere only", param_hint="--two-parameters")
    require_place(output)
    indenter = Indenter(shape, radius, thickness, poisson_ratio)
    found = fit(read(data), indenter, two_parameters=two_parameters)
    file = material_file(found, indenter, density, frequency, data.name)
    output.write_text(file.text(), encoding="utf-8")
    _print(found)
    typer.echo(
        f"at {frequency:g} Hz: young_modulus {file.young_modulus / 1e3:.4g} kPa, damping"
        f" {file.damping * 1e3:.3g} ms\nwrote {output}; name it in a scenario:"
        f" organs: {{NAME: {{material_file: {output}}}}}"
    )


def _print(found: Calibration) -> None:
    relaxation = found.relaxation
    rows = [
        ("young_modulus", "modulus at once, kPa", found.young_modulus, 1e-3),
        *([] if found.stiffening is None else [("stiffening", "stiffening", found.stiffening, 1.0)]),
        ("surface", "surface at, mm", found.surface, 1e3),
        ("share_1", "relaxes quickly, %", relaxation.shares[0], 1e2),
        ("time_1", "within, s", relaxation.times[0], 1.0),
        ("share_2", "relaxes slowly, %", relaxation.shares[1], 1e2),
        ("time_2", "within, s", relaxation.times[1], 1.0),
        *([] if found.friction is None else [("friction", "friction", found.friction, 1.0)]),
    ]
    for name, label, value, unit in rows:
        typer.echo(f"{label:22}{value * unit:10.4g} +- {found.deviations[name] * unit:.2g}")
    typer.echo(f"residual of the force  {found.residual:9.2%}")
    if found.residual > _LARGE_RESIDUAL:
        typer.echo(
            f"warning: {found.residual:.0%} of the force is unexplained, at most {_LARGE_RESIDUAL:.0%} are"
            " expected: the fit does not describe this tissue. Check --shape, --radius, --thickness and the"
            " zero of depth",
            err=True,
        )
