"""The commands `trocar model`: kinematics and dynamics of an arm, and the model as files."""

from __future__ import annotations

import json
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import numpy as np
import typer
from pydantic import TypeAdapter, ValidationError
from typer.core import TyperCommand

from engines.mujoco.params import MujocoParams, SceneParams
from engines.mujoco.pictures.opengl import import_mujoco
from robots import command_line as kinematics
from robots.dvrk.arms import ARMS, DEFAULT_INSTRUMENT
from robots.dvrk.setup_joints import CartArm
from schemas.errors import MissingExtraError, MotionError, did_you_mean
from schemas.files import Files
from schemas.quantity import Duration

if TYPE_CHECKING:
    from engines.mujoco.model.dynamics import JointDynamics

__all__ = ["app"]

app = typer.Typer(help="Numbers and files of the robot's model.", no_args_is_help=True)

_DURATION = TypeAdapter(Duration)
_CART: tuple[CartArm, ...] = get_args(CartArm)


class _NumbersInARow(TyperCommand):
    """Accepts `--q 0.1 -0.2 0.3` like `--q 0.1,-0.2,0.3`: all numbers that follow belong to the option."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        for option in ("--q", "--dq", "--orientation", "--setup-joints"):
            if option in args:
                start = args.index(option) + 1
                end = start
                while end < len(args) and _numbers(args[end]) is not None:
                    end += 1
                if end > start:
                    args = [*args[: start - 1], f"{option}={','.join(args[start:end])}", *args[end:]]
        return super().parse_args(ctx, args)


def _numbers(text: str) -> list[float] | None:
    try:
        return [float(number) for number in text.replace(",", " ").split()]
    except ValueError:
        return None


def _row(text: str, count: int, option: str) -> list[float]:
    numbers = _numbers(text) or []
    if len(numbers) != count:
        raise typer.BadParameter(f"{len(numbers)} numbers, expected {count}", param_hint=option)
    return numbers


def _check_numbers(text: str | None) -> str | None:
    if text is not None and not _numbers(text):
        raise typer.BadParameter(
            f"'{text}' contains no numbers; write one per joint in SI units, separated by spaces or commas"
        )
    return text


Arm = Annotated[
    str, typer.Argument(metavar="ARM", help=f"One of {', '.join(ARMS)}.", autocompletion=lambda: list(ARMS))
]
ArmArgument = Annotated[
    str, typer.Argument(metavar="ARM", help=f"One of {', '.join(_CART)}.", autocompletion=lambda: list(_CART))
]
Tool = Annotated[
    str | None,
    typer.Option(
        "--instrument",
        metavar="N",
        help=(
            "Of a PSM: its instrument, by name or number (400006 unless given); of the ECM: straight, up or"
            " down."
        ),
    ),
]
Positions = Annotated[
    str, typer.Option("--q", metavar="Q1 Q2 ...", callback=_check_numbers, help="Joint positions, rad and m.")
]
Velocities = Annotated[
    str | None,
    typer.Option(
        "--dq",
        metavar="V1 V2 ...",
        callback=_check_numbers,
        help="Joint velocities for the friction, rad/s and m/s; 0 unless given.",
    ),
]
Own = Annotated[
    Path | None,
    typer.Option(
        "--dynamics",
        metavar="FILE",
        help="Of a PSM: a file of `trocar identify`; the published ones unless given.",
    ),
]
Mounting = Annotated[
    Literal["cart", "free"],
    typer.Option(help="On the cart's setup joints, or one arm alone with its base in the origin."),
]
Orientation = Annotated[
    str | None,
    typer.Option(
        metavar="X Y Z W",
        callback=_check_numbers,
        help="Of a free base in the world, whose z is up: a quaternion; upright unless given.",
    ),
]
SetupJoints = Annotated[
    str | None,
    typer.Option(
        metavar="Q1 ... Q6",
        callback=_check_numbers,
        help="Of the setup joints that carry it on the cart, m and rad; the simulated ones unless given.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]


@app.command(cls=_NumbersInARow)
def fk(arm: Arm, *, instrument: Tool = None, q: Positions, as_json: Json = False) -> None:
    """Print the pose of an arm's tip in its base frame: p in m and the rotation matrix R."""
    with _refusing():
        pose = kinematics.fk(arm, instrument, _numbers(q) or [])
    typer.echo(json.dumps(pose, indent=2) if as_json else kinematics.table(pose))


@app.command(cls=_NumbersInARow)
def dynamics(
    arm: ArmArgument,
    *,
    instrument: Tool = None,
    own: Own = None,
    q: Positions,
    dq: Velocities = None,
    mounting: Mounting = "free",
    orientation: Orientation = None,
    setup_joints: SetupJoints = None,
    as_json: Json = False,
) -> None:
    """Print an arm's joint-space inertia, gravity, friction and elasticity as its base stands; SI units."""
    _need_mujoco("dynamics")
    name, positions = _cart_arm(arm), _numbers(q) or []
    tool = instrument or ("straight" if name == "ECM" else DEFAULT_INSTRUMENT)
    velocities = [0.0] * len(positions) if dq is None else _numbers(dq) or []
    with _refusing():
        kinematics.fk(arm, tool, positions)  # raises MotionError where one is out of range
        if len(velocities) != len(positions):
            raise MotionError(f"{arm}: {len(velocities)} joint velocities, expected {len(positions)}")
        if not np.isfinite(velocities).all():
            raise MotionError(f"{arm}: not all joint velocities are finite: {velocities}")
        from engines.mujoco.model.dynamics import dynamics as of

        base: dict[str, Any] = {"mounting": mounting}
        if orientation is not None:
            base["orientation"] = _row(orientation, 4, "--orientation")
        if setup_joints is not None:
            base["setup_joints"] = _row(setup_joints, 6, "--setup-joints")
        found = of(name, tool, positions, velocities, own, base=base)
    if as_json:
        typer.echo(
            json.dumps(
                {"arm": arm, "instrument": tool, "q": positions, "dq": velocities, **_plain_summary(found)},
                indent=2,
            )
        )
    else:
        _print(found)


def _plain_summary(found: JointDynamics) -> dict[str, Any]:
    return {
        key: value.tolist() if isinstance(value, np.ndarray) else value
        for key, value in asdict(found).items()
    }


def _print(found: JointDynamics) -> None:
    columns = {
        "gravity": found.gravity,
        "elastic": found.elastic,
        "viscous": found.viscous_friction,
        "coulomb": found.coulomb_friction,
        "friction": found.friction,
    }
    if not np.array_equal(found.base, np.eye(3)):
        up = ", ".join(f"{part:.4f}" for part in found.base[2].tolist())
        typer.echo(f"the base is turned: up is {up} in its frame")
    width = max(map(len, found.joints))
    typer.echo(f"{'':{width}}{''.join(f'{title:>11}' for title in columns)}   inertia matrix")
    for i, name in enumerate(found.joints):
        row = "".join(f"{column[i]:11.5f}" for column in columns.values())
        typer.echo(f"{name:{width}}{row}   {''.join(f'{cell:11.6f}' for cell in found.inertia[i])}")


@app.command()
def export(
    path: Annotated[
        Path,
        typer.Argument(
            help=(
                "File (.xml, .urdf or .fmu), or folder for dvrk.xml, dvrk.urdf or dvrk.fmu; the meshes of"
                " .xml and .urdf go to assets beside it."
            )
        ),
    ],
    *,
    arms: Annotated[str, typer.Option(metavar="ARM,ARM", help="Which arms of the cart.")] = ",".join(_CART),
    instrument: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ARM=N",
            help=(
                "Instrument of a PSM or endoscope of the ECM (400006 and straight unless given). May be"
                " repeated."
            ),
        ),
    ] = None,
    own: Annotated[
        list[str] | None,
        typer.Option(
            "--dynamics",
            metavar="ARM=FILE",
            help="File of `trocar identify` for a PSM (published dynamics unless given). May be repeated.",
        ),
    ] = None,
    mounting: Mounting = "cart",
    form: Annotated[
        Literal["mjcf", "urdf", "fmu"] | None,
        typer.Option("--format", help="By default that of the file's suffix, else mjcf."),
    ] = None,
    fmi: Annotated[Literal["2", "3"], typer.Option(help="Of an FMU: version 2.0 or 3.0 of FMI.")] = "3",
    step: Annotated[
        str,
        typer.Option(help="Of an FMU: the period of its servos, which communication steps are multiples of."),
    ] = "1 ms",
) -> None:
    """Write the robot's model as MJCF or URDF with its meshes, or the servoed robot as an FMU."""
    _need_mujoco("export")
    from engines.mujoco.export import FORMATS, write

    known = FORMATS.get(path.suffix)
    form = form or known or "mjcf"
    if known is None:
        path = path / {"mjcf": "dvrk.xml", "urdf": "dvrk.urdf", "fmu": "dvrk.fmu"}[form]
    named: list[CartArm] = [_cart_arm(arm) for arm in arms.replace(",", " ").split()]
    if not named:
        raise typer.BadParameter(f"name at least one of {', '.join(_CART)}", param_hint="--arms")
    scene = _scene(named, instrument or [], own or [], mounting)
    try:
        if form == "fmu":
            typer.echo(f"{path}  ({_write_fmu(scene, path, fmi, step)})")
        else:
            files = write(scene, path, form)
            typer.echo(f"{path}  ({len(files) - 1} meshes in {path.parent / 'assets'})")
    except OSError as error:
        raise typer.BadParameter(f"cannot write there: {error}", param_hint="PATH") from error


def _write_fmu(scene: SceneParams, path: Path, fmi: Literal["2", "3"], step: str) -> str:
    """Write the FMU, and return a summary in words."""
    from engines.mujoco.export.fmu import write_fmu

    with _refusing():
        period = _DURATION.validate_python(step)
        params = MujocoParams.model_validate({name: getattr(scene, name) for name in scene.model_fields_set})
    robot = write_fmu(params, path, fmi, period)
    inputs, outputs = len(robot.inputs), len(robot.outputs)
    return f"FMI {fmi}.0 co-simulation, {inputs} inputs, {outputs} outputs, steps of {period / 1e6:g} ms"


def _scene(arms: list[CartArm], instruments: list[str], own: list[str], mounting: str) -> SceneParams:
    tools = {arm: {} if arm == "ECM" else {"instrument": DEFAULT_INSTRUMENT} for arm in arms}
    for text in instruments:
        arm, tool = _of_arm(text, arms, "--instrument", "400006")
        tools[arm] = {"endoscope" if arm == "ECM" else "instrument": tool}
    for text in own:
        arm, file = _of_arm(text, arms, "--dynamics", "my_psm.yaml")
        tools[arm] |= {"dynamics": file}
    if mounting == "free" and len(tools) > 1:
        raise typer.BadParameter(
            f"{len(tools)} arms would be at the same place; name one with --arms, or mount them on the cart",
            param_hint="--mounting",
        )
    with _refusing():
        stated = {"arms": tools, "mounting": mounting}
        return SceneParams.model_validate(stated, context=Files(Path.cwd()).context)


def _of_arm(text: str, arms: list[CartArm], option: str, example: str) -> tuple[CartArm, str]:
    """Return the arm and the value of `text`, which is ARM=VALUE with one of `arms`."""
    arm, _, value = text.partition("=")
    if arm not in arms or not value:
        problem = (
            f"'{text}' is not ARM={example} with an arm of this model: {', '.join(arms)}; write for instance"
            f" {arms[0]}={example}"
        )
        raise typer.BadParameter(problem, param_hint=option)
    return _cart_arm(arm), value


def _cart_arm(arm: str) -> CartArm:
    if arm not in _CART:
        raise typer.BadParameter(f"no arm '{arm}' in the model.{did_you_mean(arm, _CART)}")
    return arm


@contextmanager
def _refusing() -> Generator[None]:
    """Report what an arm cannot do as bad usage."""
    try:
        yield
    except MotionError as error:
        raise typer.BadParameter(str(error)) from error
    except ValidationError as error:
        raise typer.BadParameter(
            "; ".join(problem["msg"].removeprefix("Value error, ") for problem in error.errors())
        ) from error


def _need_mujoco(command: str) -> None:
    if find_spec("mujoco") is None:
        raise MissingExtraError(f"'trocar model {command}'", "mujoco", "mujoco")
    import_mujoco()
