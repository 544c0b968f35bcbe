"""The numbers of a robot as C: `tables.h`, compiled into the FMU's library."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from engines.mujoco.export.fmu.robot import Robot
from schemas.vectors import Vector

__all__ = ["tables"]

_TRIALS = 200
"""Random products for the comparison of roundings: about half of them differ where the roundings do."""


def tables(robot: Robot, token: str, model_file: str, model_size: int) -> str:
    """Return `tables.h` of `robot`.

    `token`: the FMU's GUID; `model_file`: the model as MJB, of `model_size` bytes.
    """
    law, variables, inputs = robot.law, robot.variables, len(robot.inputs)
    model, arms = robot.model, robot.params.arms
    sizes: dict[str, object] = {
        "DRIVES": law.lower.size,
        "ARMS": len(arms),
        "SENSORS": model.nsensordata,
        "PHYSICS": robot.physics.size,
        "SUB_STEPS": robot.sub_steps,
        "GRAVITY": inputs,
        "OUTPUTS_FROM": inputs + 1,
        "VALUES": len(variables),
        "MODEL_SIZE": model_size,
        "PERIOD": (robot.period_ns * 1e-9).hex(),
        "MOST_GRAVITY": (robot.gravity.limits or (0.0, 0.0))[1].hex(),
        "TOKEN": f'"{token}"',
        "MODEL_FILE": f'"{model_file}"',
    }
    lines = [f"#define {name} {size}" for name, size in sizes.items()]
    # a product that is added to a number: values[target] += factor * sources[source]
    lines.append("typedef struct { int target, source; double factor; } Term;")
    lines += [_term_table("SERVO", law.layout), _term_table("READ", robot.reading())]
    starts = np.array([variable.start for variable in variables])
    for name, row in {
        "LOWER": law.lower,
        "UPPER": law.upper,
        "WAY": law.way,
        "SPRING": law.springs,
        "REST": law.rest,
        "VALUES_AT_START": starts,
        "PHYSICS_AT_START": robot.physics,
    }.items():
        lines.append(f"static const double {name}[] = {{{_row(row)}}};")
    turns = ", ".join(f"{{{_row(robot.params.base_pose(arm)[:3, :3])}}}" for arm in arms)
    lines.append(f"static const double BASE[ARMS][9] = {{{turns}}};")
    tips = ", ".join(str(model.site(f"{arm}/tip").id) for arm in arms)
    lines.append(f"static const int TIP[] = {{{tips}}};")
    fused = ", ".join(str(int(row)) for row in _fused(law.layout))
    lines.append(f"static const char FUSED[] = {{{fused}}};")
    names = ", ".join(f'"{variable.name}"' for variable in variables[: inputs + 1])
    lines.append(f"static const char *const NAMES[] = {{{names}}};")
    return "\n".join(lines) + "\n"


def _terms(matrix: Vector) -> list[tuple[int, int, float]]:
    """Return row, column and value of the numbers of a matrix that are not 0, row by row."""
    rows, columns = np.nonzero(matrix)
    places = zip(rows.tolist(), columns.tolist(), strict=True)
    return [(row, column, float(matrix[row, column])) for row, column in places]


def _term_table(name: str, matrix: Vector) -> str:
    terms = ", ".join(f"{{{row}, {column}, {factor.hex()}}}" for row, column, factor in _terms(matrix))
    return f"static const Term {name}[] = {{{terms}}};"


def _row(values: Vector | Sequence[float]) -> str:
    return ", ".join(_literals(np.ravel(values).tolist()))


def _literals(values: Sequence[float]) -> Iterator[str]:
    for value in values:
        yield value.hex() if np.isfinite(value) else "INFINITY" if value > 0 else "-INFINITY"


def _fused(layout: Vector) -> list[bool]:
    """Return the rows of the servos' matrix that numpy sums with one rounding per product and sum.

    That depends on BLAS's kernel, the size of the matrix and the place of the row; see docs/decisions/0158.
    """
    random, found = np.random.default_rng(1), np.empty(len(layout))
    terms = _terms(layout)
    fused = [False] * len(layout)
    for _ in range(_TRIALS):
        sources: Vector = np.asarray(random.normal(size=layout.shape[1]), np.float64)
        layout.dot(sources, found)
        apart = [0.0] * len(layout)
        for row, column, factor in terms:
            apart[row] += factor * float(sources[column])
        fused = [
            before or one != other for before, one, other in zip(fused, apart, found.tolist(), strict=True)
        ]
    return fused
