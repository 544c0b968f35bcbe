"""The command `trocar identify`."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robots.dvrk.instruments import instrument as tool_of
from schemas.errors import MissingExtraError, MotionError
from schemas.user_files import require_place

if TYPE_CHECKING:
    from robots.identification.arms import IdentifiedArm
    from robots.identification.fit import Fit
    from schemas.vectors import Vector

__all__ = ["app"]

app = typer.Typer()

_PACKAGES = ("matplotlib", "scipy")
_ARMS = ("PSM1", "PSM2", "PSM3", "ECM")
_RATE = 100.0
"""Hz, of the commands of an exciting motion."""


@app.command()
def identify(
    recordings: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[RECORDING...]",
            exists=True,
            help="MCAP, rosbag 1 or 2, or CSV with measured_js of the arm.",
        ),
    ] = None,
    *,
    arm: Annotated[str, typer.Option(help=f"One of {', '.join(_ARMS)}.")] = "PSM1",
    instrument: Annotated[
        str, typer.Option(metavar="N", help="What a PSM held, by name or number.")
    ] = "400006",
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The file for the scenario, .yaml; of a motion a directory.",
        ),
    ],
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Predicted over measured efforts, .png, .svg or .pdf."),
    ] = None,
    cutoff: Annotated[float, typer.Option(min=0.5, max=100.0, help="Of the zero-phase low-pass, Hz.")] = 6.0,
    rate: Annotated[
        float, typer.Option(min=20.0, max=1000.0, help="Samples in a second for the fit.")
    ] = 100.0,
    owner: Annotated[
        str, typer.Option("--of", metavar="NAME", help="Whose states count in the recording of a session.")
    ] = "",
    stribeck: Annotated[
        bool, typer.Option("--stribeck", help="Friction that is larger at rest, too.")
    ] = False,
    up: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z",
            help="Where up is in the frame of a turned base, as `trocar model dynamics` prints it.",
        ),
    ] = None,
    excite: Annotated[
        bool, typer.Option("--excite", help="Instead write a motion that tells the most, as servo_jp.")
    ] = False,
    periods: Annotated[int, typer.Option(min=1, max=30, help="Of the motion, 20 s each.")] = 3,
    seed: Annotated[int, typer.Option(min=0, help="Another motion for each.")] = 0,
) -> None:
    """Find the dynamics of your own arm from its measured joint positions and efforts."""
    for package in _PACKAGES:
        if find_spec(package) is None:
            raise MissingExtraError("'trocar identify'", "identify", package)
    if excite == bool(recordings):
        raise typer.BadParameter("name recordings to identify from, or --excite for a motion to record")
    from robots.identification.arms import of_ecm, of_psm

    if arm not in _ARMS:
        raise typer.BadParameter(f"'{arm}' is none of {', '.join(_ARMS)}", param_hint="--arm")
    try:
        tool = None if arm == "ECM" else tool_of(instrument)
    except MotionError as error:
        raise typer.BadParameter(str(error), param_hint="--instrument") from error
    if excite:
        _write_excitation(output, arm, of_ecm() if tool is None else of_psm(tool, jaw=True), periods, seed)
        return
    from learning.identification.figures import write_figure
    from learning.identification.measurements import has_jaw, measurements
    from robots.identification.fit import fit
    from robots.identification.result import own_dynamics
    from robots.identification.signals import filter_signals

    paths = recordings or []
    for file in (output, plot):
        if file is not None:
            require_place(file)
    jaw = tool is not None and tool.jaw is not None and all(has_jaw(path, arm) for path in paths)
    moving = of_ecm() if tool is None else of_psm(tool, jaw=jaw)
    joints = [joint.name for joint in moving.joints]
    samples = [filter_signals(measurements(path, arm, joints, owner), cutoff, rate) for path in paths]
    found = fit(samples, moving, gravity=_gravity(up), stribeck=stribeck)
    output.write_text(own_dynamics(found, cutoff, [path.name for path in paths]).text(), "utf-8")
    _print(found, joints)
    if plot is not None:
        write_figure(plot, found, joints)
    typer.echo(f"wrote {output}; name it in a scenario: arms: {{{arm}: {{dynamics: {output}}}}}")


def _write_excitation(output: Path, arm: str, moving: IdentifiedArm, periods: int, seed: int) -> None:
    from learning.identification.excitation import write_excitation
    from robots.identification.excitation import PERIOD, excitation

    motion = excitation(moving, periods, _RATE, seed)
    joints = [joint.name for joint in moving.joints]
    write_excitation(output, arm, joints, motion)
    typer.echo(f"condition number {motion.condition:.3g}; largest position, velocity and acceleration:")
    for i, joint in enumerate(moving.joints):
        q, dq, ddq = (abs(values[:, i]).max() for values in (motion.q, motion.dq, motion.ddq))
        unit = joint.unit
        typer.echo(f"  {joint.name:12} {q:7.3f} {unit} {dq:7.3f} {unit}/s {ddq:7.3f} {unit}/s^2")
    typer.echo(
        f"wrote {output}, {periods * PERIOD:g} s from and to {arm} at home; play it:\n  trocar run identify"
        f" --set participants.commands.bag={output.resolve()} --record recordings/identify"
    )


def _gravity(up: str | None) -> Vector | None:
    """Return the acceleration of gravity in the base frame, m/s^2, shape (3,); None of an upright base."""
    import numpy as np

    from robots.dvrk.dynamics import STANDARD_GRAVITY

    if up is None:
        return None
    try:
        direction = np.array([float(number) for number in up.split(",")])
    except ValueError:
        direction = np.zeros(0)
    if direction.shape != (3,) or not 0.0 < (length := np.linalg.norm(direction)) < np.inf:
        raise typer.BadParameter(
            f"'{up}' is no direction: three numbers, such as 0,0.5,0.87", param_hint="--up"
        )
    return np.asarray(-STANDARD_GRAVITY / length * direction, np.float64)


def _print(found: Fit, joints: list[str]) -> None:
    typer.echo(
        f"{len(found.time)} samples, {len(found.base_values)} base parameters, condition number"
        f" {found.condition:.3g}\nrelative residual on the last quarter, which the fit has not seen:"
    )
    for joint, own, published in zip(joints, found.residual, found.published_residual, strict=True):
        typer.echo(f"  {joint:12} {own:7.1%}   by the published parameters {published:7.1%}")
