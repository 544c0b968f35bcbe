"""The force on a sphere pressed into tissue, beside that of finite elements.

python bench/indentation.py --json indentation.json --picture docs/pictures/indentation.png

Over depth, radius, mesh and place, at rest and at 5 Hz. A block of 80 x 60 x 20 mm, 10 kPa, is pressed over a
node, and in the middle of a face, where Bullet's contacts lose most. The reference is Newton's method on the
same mesh with the same friction (tests/engines/bullet/finite_elements.py); `continuum` is that on a mesh of
2000 nodes, so it shows the error of the mesh. Results: docs/decisions/0015-contact-force.md.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' truth

from engines.bullet.params import BulletParams
from schemas.vectors import Vector
from tests.engines.bullet.finite_elements import Body
from tests.engines.bullet.rig import Rig

NODES = {"coarse": 250, "fine": 1000}
TIMESTEP_S = {250: 1e-3, 1000: 0.5e-3}
"""Sub-step times highest frequency is 1.6 and 1.3."""
CONTINUUM_NODES = 2000
RADII_M = (2e-3, 3e-3, 4e-3, 5e-3)
DEPTHS_M: Vector = np.arange(1, 7) * 1e-3
FREQUENCY_HZ, MIDDLE_M, AMPLITUDE_M = 5.0, 3e-3, 2e-3


@dataclass(frozen=True)
class Row:
    """Forces (N) at `DEPTHS_M`, and the correlation with the truth at 5 Hz."""

    mesh: str
    place: str
    radius_m: float
    force_n: list[float]
    truth_n: list[float]
    correlation: float


def params(nodes: int, radius: float) -> BulletParams:
    """Return the block of about so many nodes and its probe of `radius` (m)."""
    organ = {"size": ["80 mm", "60 mm", "20 mm"], "young_modulus": "10 kPa", "nodes": nodes}
    return BulletParams.model_validate(
        {
            "organs": {"block": organ},
            "probes": {"probe": {"radius": radius}},
            "sub_grid": False,
            "timestep": TIMESTEP_S.get(nodes, 0.5e-3),
        }
    )


def places(model: BulletParams) -> dict[str, Vector]:
    """Return where to press, (x, y) in m: a node in the middle of the top, and a face beside it."""
    mesh = model.organs["block"].rest
    top = mesh.nodes[mesh.triangles]
    middles = top[(top[:, :, 2] == mesh.nodes[:, 2].max()).all(axis=1)].mean(axis=1)
    return {"node": np.zeros(2), "face": middles[np.linalg.norm(middles[:, :2], axis=1).argmin(), :2]}


def truth(nodes: int, radius: float, at: Vector, depths: Vector) -> Vector:
    """Return the force (N) of finite elements at rest at every depth (m)."""
    body = Body(params(nodes, radius).organs["block"])
    return np.array([body.press([[*at, radius - depth]], [radius])[0, 2] for depth in depths])


def pressed(model: BulletParams, at: Vector, radius: float) -> Iterator[float]:
    """Yield the force (N) at rest at every depth."""
    with Rig(model, start=(*at, radius + 1e-3)) as rig:
        for depth in DEPTHS_M:
            rig.move((*at, radius - depth), 0.06)
            rig.hold(0.2)
            yield float(rig.force[2])


def correlation(model: BulletParams, at: Vector, radius: float, curve: tuple[Vector, Vector]) -> float:
    """Return the correlation of the force at 5 Hz with `curve`, over two periods.

    `curve`: depths (m) and forces (N) of the finite elements.
    """
    w = 2.0 * np.pi * FREQUENCY_HZ

    def motion(t: float) -> tuple[Vector, Vector]:
        return np.array([*at, radius - MIDDLE_M - AMPLITUDE_M * np.sin(w * t)]), np.array(
            [0.0, 0.0, -AMPLITUDE_M * w * np.cos(w * t)]
        )

    with Rig(model, start=(*at, radius + 1e-3)) as rig:
        rig.move((*at, radius - MIDDLE_M), 0.1)
        force = rig.follow(motion, 0.6)[200:, 2]
    # the force is the mean of a step of 1 ms
    depths = MIDDLE_M + AMPLITUDE_M * np.sin(w * (np.arange(200, 600) + 0.5) * 1e-3)
    coefficients = np.polynomial.Polynomial.fit(*curve, deg=4)
    return float(np.corrcoef(force, coefficients(depths))[0, 1])


def study() -> Iterator[Row]:
    """Yield the table."""
    for mesh, nodes in NODES.items():
        for place in ("node", "face"):
            for radius in RADII_M:
                model = params(nodes, radius)
                at = places(model)[place]
                expected = truth(nodes, radius, at, DEPTHS_M)
                found = correlation(
                    model, at, radius, (np.array([0.0, *DEPTHS_M]), np.array([0.0, *expected]))
                )
                yield Row(mesh, place, radius, list(pressed(model, at, radius)), expected.tolist(), found)


def picture(rows: list[Row], continuum: dict[float, list[float]], path: Path) -> None:
    """Draw force against depth, Bullet as points and the truth as lines."""
    from matplotlib.figure import Figure

    figure: Any = Figure(figsize=(9, 3.6), layout="constrained")
    axes: Any = figure.subplots(1, 4, sharey=True)
    panels = [(mesh, place) for mesh in NODES for place in ("node", "face")]
    for axis, (mesh, place) in zip(axes, panels, strict=True):
        axis.set_title(f"{mesh} mesh, over a {place}", fontsize=9)
        axis.set_xlabel("depth, mm")
        for row in (
            row for row in rows if (row.mesh, row.place) == (mesh, place) and row.radius_m in continuum
        ):
            (line,) = axis.plot(
                DEPTHS_M * 1e3, row.truth_n, label=f"truth, same mesh, {row.radius_m * 1e3:.0f} mm"
            )
            axis.plot(
                DEPTHS_M * 1e3,
                row.force_n,
                "o",
                markersize=4,
                color=line.get_color(),
                label=f"Bullet, {row.radius_m * 1e3:.0f} mm",
            )
            axis.plot(
                DEPTHS_M * 1e3,
                continuum[row.radius_m],
                ":",
                color=line.get_color(),
                label=f"truth, {CONTINUUM_NODES} nodes",
            )
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("force, N")
    axes[0].legend(fontsize=7)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90)


def main() -> None:
    """Print the table; write it as JSON and as a picture where asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--picture", type=Path)
    args = parser.parse_args()
    rows: list[Row] = []
    for row in study():
        rows.append(row)
        ratios = " ".join(
            f"{100 * (force / true - 1):+6.1f}" for force, true in zip(row.force_n, row.truth_n, strict=True)
        )
        print(
            f"{row.mesh:6} {row.place:4} {row.radius_m * 1e3:.0f} mm  error, %: {ratios}  correlation at 5 Hz"
            f" {row.correlation:.5f}",
            flush=True,
        )
    continuum = {
        radius: truth(CONTINUUM_NODES, radius, np.zeros(2), DEPTHS_M).tolist()
        for radius in (RADII_M[0], RADII_M[-1])
    }
    for radius, forces in continuum.items():
        print(f"{CONTINUUM_NODES} nodes, {radius * 1e3:.0f} mm: {np.round(forces, 3).tolist()} N", flush=True)
    if args.json:
        args.json.write_text(
            json.dumps({"rows": [asdict(row) for row in rows], "continuum_n": continuum}, indent=2) + "\n"
        )
    if args.picture:
        picture(rows, continuum, args.picture)


if __name__ == "__main__":
    main()
