"""The commands `trocar study`: what an instrument can do, counted over a set of tasks."""

from __future__ import annotations

import json
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from schemas.errors import MissingExtraError

if TYPE_CHECKING:
    from robots.dvrk.stitch_study import Study

__all__ = ["app"]

app = typer.Typer(help="What an instrument can do, counted over a set of tasks.", no_args_is_help=True)

_COLUMNS = {
    "feasible_share": "rolling",
    "feasible_share_regrasped": "regrasped",
    "feasible_share_without": "without",
}


@app.callback()
def _keep_group() -> None:
    """Make it a group, although it has a single command."""


@app.command()
def rolling(
    *,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also draw the shares: .png, .svg or .pdf.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")] = False,
) -> None:
    """Print which share of a set of stitches a PSM can make; takes some seconds.

    It compares a needle driver that rolls the needle in hand with one that does not.
    """
    if plot is not None and plot.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise typer.BadParameter(
            f"'{plot}' is not a picture file, allowed are .png, .svg and .pdf", param_hint="--plot"
        )
    from robots.dvrk.stitch_study import study

    made = study()
    found = _share_text(made)
    typer.echo(json.dumps(found, indent=2) if as_json else _text(found))
    if plot is not None:
        _draw(found, plot)


def _share_text(made: Study) -> dict[str, Any]:
    by = {
        f"by_{what}_deg": {f"{degrees(value):.6g}": shares for value, shares in made.shares_by(what).items()}
        for what in ("tilt", "direction", "entry")
    }
    return {
        "stitches": len(made.stitches),
        **made.shares(),
        "only_by_rolling_share": float((made.rolling & ~made.without).mean()),
        "grasp_without_deg": degrees(made.rolls[made.best]),
        **by,
        "by_hold": {f"{value:.6g}": shares for value, shares in made.shares_by("hold").items()},
        "by_grasp_deg": {
            f"{degrees(roll):.6g}": share
            for roll, share in zip(made.rolls.tolist(), made.constant.mean(axis=0).tolist(), strict=True)
        },
    }


def _text(found: dict[str, Any]) -> str:
    lines = [f"Share of {found['stitches']} stitches that a PSM can make", "", _row("", _COLUMNS.values())]
    lines.append(_row("all", (f"{found[name]:.3f}" for name in _COLUMNS)))
    for what, unit in (
        ("tilt_deg", " deg tilt"),
        ("direction_deg", " deg direction"),
        ("entry_deg", " deg entry"),
        ("hold", " of the arc behind the tip"),
    ):
        lines += [
            "",
            *(
                _row(f"{value}{unit}", (f"{shares[name]:.3f}" for name in _COLUMNS))
                for value, shares in found[f"by_{what}"].items()
            ),
        ]
    without = (
        f"without: the needle grasped at a roll of {found['grasp_without_deg']:.0f} degrees, which serves"
        " most stitches"
    )
    return "\n".join(
        [
            *lines,
            "",
            without,
            "regrasped: at the roll that each stitch needs; rolling: the needle is turned in hand on the way",
        ]
    )


def _row(name: str, cells: Any) -> str:
    return f"{name:<34}" + "".join(f"{cell:>12}" for cell in cells)


def _draw(found: dict[str, Any], path: Path) -> None:
    """Draw the shares by direction, and over the grasp without rolling.

    Raises MissingExtraError without matplotlib.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("'trocar study --plot'", "report", "matplotlib") from error
    figure: Any = Figure(figsize=(9.0, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    by_direction, by_grasp = found["by_direction_deg"], found["by_grasp_deg"]
    # later ones may hide earlier ones
    for (name, label), size in zip(_COLUMNS.items(), (9, 6, 4), strict=True):
        shares = [each[name] for each in by_direction.values()]
        left.plot([float(value) for value in by_direction], shares, marker="o", markersize=size, label=label)
        right.axhline(found[name], color=left.lines[-1].get_color(), linestyle="--")
    left.set(
        xlabel="direction of the stitch (deg)",
        ylabel="share of feasible stitches",
        ylim=(0.0, 1.0),
        xticks=range(0, 360, 60),
    )
    left.legend()
    right.plot([float(roll) for roll in by_grasp], list(by_grasp.values()), marker="o", color="black")
    right.set(xlabel="roll at which the needle is grasped, without rolling (deg)", xticks=range(-90, 91, 30))
    figure.savefig(path)
