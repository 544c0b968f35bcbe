"""The command `trocar relive`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from importlib.util import find_spec
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import typer

import trocar
from schemas.errors import MissingExtraError, RecordingError

if TYPE_CHECKING:
    from learning.relive.arms import PlacedArm, Way
    from learning.relive.doubts import Reading
    from learning.relive.session import Residual

__all__ = ["app"]

app = typer.Typer()

_PSMS = ("PSM1", "PSM2", "PSM3")
_STILL = 1e-6
"""Largest change of a number, m or a part of a quaternion, of an arm that stays."""
_FEW = 0.9
"""Share of frames in reach below which the stated reading is in doubt."""


@app.command()
def relive(
    dataset: Annotated[
        Path,
        typer.Argument(
            metavar="DATASET",
            help="A LeRobotDataset, an episode of SutureBot (ee_csv.csv), or a session of dvrk_data.",
        ),
    ],
    *,
    episode: Annotated[int, typer.Option(min=0, help="Number of the episode.")] = 0,
    convention: Annotated[
        Literal["jhu", "hamlyn"],
        typer.Option(
            help="The laboratory: jhu (also SutureBot, and our own), quaternions x y z w; hamlyn, w x y z."
        ),
    ] = "jhu",
    order: Annotated[
        Literal["xyzw", "wxyz"] | None, typer.Option(help="Order of quaternions, if another.")
    ] = None,
    unit: Annotated[Literal["m", "mm"] | None, typer.Option(help="Unit of positions, if another.")] = None,
    frame: Annotated[
        Literal["ECM", "world", "base"] | None,
        typer.Option(
            help="Reference frame of poses; default: what the data set states, else the endoscope's tip."
        ),
    ] = None,
    arms: Annotated[
        str | None, typer.Option(metavar="ARM,ARM", help="Arms in the order of a row, if others.")
    ] = None,
    scenario: Annotated[
        str, typer.Option(metavar="NAME|PATH", help="A scenario with the arms where they stand, and objects.")
    ] = "pick-and-place",
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="A.B=VALUE", help="Override one value of it. May be repeated."),
    ] = None,
    record: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Record the session in this new directory.")
    ] = None,
) -> None:
    """Let the arms of a scenario follow the set-points of a recorded episode; report what is left.

    Other readings of the numbers, by unit and order of quaternions, are tried and compared at the tip.
    """
    if find_spec("pyarrow") is None:
        raise MissingExtraError("'trocar relive'", "dataset", "pyarrow")
    from learning.relive.arms import placed_arms
    from learning.relive.convention import CONVENTIONS
    from learning.relive.doubts import readings
    from learning.relive.dvrk_session import is_dvrk_session, session_ways
    from learning.relive.episode_file import EpisodeFile
    from learning.relive.session import robot_of

    values = {path: value for path, _, value in (each.partition("=") for each in overrides or ())}
    loaded = trocar.load_scenario(scenario, set=values)
    robot: Any = loaded.params[robot_of(loaded)]
    if is_dvrk_session(dataset):
        named = _PSMS if arms is None else tuple(arms.split(","))
        placed = placed_arms(robot, tuple(arm for arm in named if arm in robot.arms), "base")
        fps, ways = session_ways(dataset, placed)
        frames = len(next(iter(ways.values())).joints)
        typer.echo(f"{frames} frames at {fps:g} Hz, joint set-points: {', '.join(ways)}")
        _follow(loaded, {arm: placed[arm] for arm in ways}, ways, fps, record)
        return
    stated = CONVENTIONS[convention]
    stated = replace(stated, order=order or stated.order, unit=unit or stated.unit)
    if arms is not None:
        stated = replace(stated, arms=tuple(arms.split(",")))
    read = EpisodeFile.read(dataset, episode, stated)
    stated = replace(stated, frame=frame or read.frame or stated.frame)
    set_points = stated.set_points(read.rows)
    moving = tuple(arm for arm in stated.arms if np.ptp(set_points[arm][:, :7], axis=0).max() > _STILL)
    if not moving:
        raise RecordingError(f"'{dataset}', episode {episode}: no arm moves")
    placed = placed_arms(robot, moving, stated.frame)
    tried = list(readings(read.rows, stated, placed))
    ways = {arm: one.way(set_points[arm]) for arm, one in placed.items()}
    typer.echo(f"{len(read.rows)} frames at {read.fps:g} Hz, poses in {stated.frame}: {', '.join(moving)}")
    _print_readings(tried)
    lost = [f"{arm}, {way.refusal}" for arm, way in ways.items() if way.share == 0.0]
    if lost:
        raise RecordingError(f"no frame is in reach: {'; '.join(lost)}")
    _follow(loaded, placed, ways, read.fps, record)


def _follow(
    loaded: trocar.ScenarioFile,
    placed: Mapping[str, PlacedArm],
    ways: Mapping[str, Way],
    fps: float,
    record: Path | None,
) -> None:
    """Let the arms follow, and print what is left."""
    from learning.relive.session import follow

    _print_residuals(follow(loaded, placed, ways, fps, record))
    for arm, way in ways.items():
        if way.refusal:
            share = 100.0 * (1.0 - way.share)
            typer.echo(f"{arm}: {share:.1f} % of the frames are out of reach: {way.refusal}")
    if record is not None:
        typer.echo(f"recorded: {record}")


def _print_readings(tried: list[Reading]) -> None:
    ours, *others = tried
    typer.echo(f"as stated: {ours}")
    for one in others:
        typer.echo(f"  else:    {one}")
    best = max(others, key=lambda one: one.reach, default=ours)
    if ours.reach < _FEW and best.reach > ours.reach:
        typer.echo(
            f"in doubt: with --order {best.convention.order} --unit {best.convention.unit}"
            f" {100.0 * best.reach:.0f} % of the frames are in reach, as stated {100.0 * ours.reach:.0f} %"
        )


def _print_residuals(residuals: Mapping[str, Residual]) -> None:
    for arm, one in residuals.items():
        joints = ", ".join(
            f"{name} {1e3 * value:.3g} mm" if one.units[name] == "m" else f"{name} {degrees(value):.3g} deg"
            for name, value in one.joints.items()
        )
        typer.echo(
            f"{arm}: tip {1e3 * one.tip_m:.3g} mm (most {1e3 * one.tip_most_m:.3g} mm) from its set-points;"
            f" {joints}"
        )
