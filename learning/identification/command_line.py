"""The command `trocar identify`."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robots.dvrk.instruments import instrument as tool_of
from schemas.errors import MissingExtraError, MotionError

if TYPE_CHECKING:
    from robots.identification.fit import Fit

__all__ = ["app"]

app = typer.Typer()

_PACKAGES = ("matplotlib", "scipy")
_ARMS = ("PSM1", "PSM2", "PSM3")


@app.command()
def identify(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECORDING...",
            exists=True,
            help="MCAP, rosbag 1 or 2, or CSV with measured_js of the arm.",
        ),
    ],
    *,
    arm: Annotated[str, typer.Option(help=f"One of {', '.join(_ARMS)}.")] = "PSM1",
    instrument: Annotated[
        str, typer.Option(metavar="N", help="What the arm held, by name or number.")
    ] = "400006",
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The file for the scenario, .yaml.")
    ],
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Predicted over measured efforts, .png, .svg or .pdf."),
    ] = None,
    cutoff: Annotated[float, typer.Option(min=0.5, max=100.0, help="Of the zero-phase low-pass, Hz.")] = 6.0,
    rate: Annotated[
        float, typer.Option(min=20.0, max=1000.0, help="Samples in a second for the fit.")
    ] = 100.0,
) -> None:
    """Find the dynamics of your own PSM from its measured joint positions and efforts."""
    for package in _PACKAGES:
        if find_spec(package) is None:
            raise MissingExtraError("'trocar identify'", "identify", package)
    if arm not in _ARMS:
        raise typer.BadParameter(f"'{arm}' is none of {', '.join(_ARMS)}", param_hint="--arm")
    try:
        tool = tool_of(instrument)
    except MotionError as error:
        raise typer.BadParameter(str(error), param_hint="--instrument") from error
    from learning.identification.figures import write_figure
    from learning.identification.measurements import measurements
    from robots.dvrk import psm
    from robots.identification.fit import fit
    from robots.identification.result import own_dynamics
    from robots.identification.signals import filtered

    joints = [joint.name for joint in psm.chain(tool).joints]
    samples = [filtered(measurements(path, arm, joints), cutoff, rate) for path in recordings]
    found = fit(samples, tool)
    output.write_text(own_dynamics(found, tool, cutoff, [path.name for path in recordings]).text(), "utf-8")
    _print(found, joints)
    if plot is not None:
        write_figure(plot, found, joints)
    typer.echo(f"wrote {output}; name it in a scenario: arms: {{{arm}: {{dynamics: {output}}}}}")


def _print(found: Fit, joints: list[str]) -> None:
    typer.echo(
        f"{len(found.time)} samples, {len(found.base_values)} base parameters, condition number"
        f" {found.condition:.3g}\nrelative residual on the last quarter, which the fit has not seen:"
    )
    for joint, own, published in zip(joints, found.residual, found.published_residual, strict=True):
        typer.echo(f"  {joint:12} {own:7.1%}   by the published parameters {published:7.1%}")
