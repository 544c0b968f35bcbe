"""The force on a sphere in tissue beside converged finite elements that are not ours, and what a step costs.

python bench/tissue_force.py --picture docs/pictures/force-of-tissue.png
python bench/tissue_force.py --kind fem --nodes 250 2000 --bodies middle liver kidney

Spheres of 2 to 5 mm, 1 to 6 mm deep, over nodes, edges and faces of meshes of about 250 and 600 nodes: in the
middle of a block of 80 x 60 x 20 mm and 10 kPa, 8 to 1.5 mm from its side, on a liver and on a kidney. The
truth is `bench/tissue_truth.json`, which `python bench/tissue_truth.py` makes. Depths are those of the
instrument: for the block from the unloaded surface, for organs from where they hang. Results:
docs/decisions/0095-converged-truth.md, near the side 0099-rims-and-held-patches.md, of kind fem
0125-tissue-of-our-own.md.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' rig

from engines.tissue.organs.body import Body
from engines.tissue.params import PressedOrgansParams
from engines.tissue.probes.near_faces import closest_points
from schemas.vectors import Vector
from tests.engines.bullet import rig as bullet
from tests.engines.bullet.rig import BLOCK, Rig
from tests.engines.fem import rig as fem

TRUTH: dict[str, Any] = json.loads((Path(__file__).parent / "tissue_truth.json").read_text())
STEPS = {250: "1 ms", 350: "1 ms", 450: "0.5 ms", 600: "0.5 ms"}
"""Sub-step of Bullet by nodes; kind fem has its own."""
RIGS: dict[str, Any] = {"bullet": bullet.Rig, "fem": fem.FemRig}
ORGANS: dict[str, dict[str, Any]] = {
    "middle": BLOCK,
    "side": BLOCK,
    "rim-5": BLOCK,
    "rim": BLOCK,
    "rim-1.5": BLOCK,
    "liver": {"shape": "liver-lobe"},
    "kidney": {"shape": "kidney-with-adrenal"},
}
PLACES = ("node", "edge", "face")
"""In the middle of the block, where the truth is the same at all; elsewhere at the site of the truth."""
NEAR_M, AROUND_M = 1e-3, 6e-3
PAUSE_S = 0.2


@dataclass(frozen=True)
class Press:
    """One press of the engine."""

    body: str
    nodes: int
    radius_m: float
    place: str
    force_n: list[float]
    cost: float
    """Processor time over simulated time, while pressed."""

    @property
    def errors(self) -> Vector:
        true = np.array(TRUTH[self.body]["force_n"][f"{self.radius_m * 1e3:g}"])
        return np.array(self.force_n[: len(true)]) / true - 1.0


def places(nodes: Vector, faces: Any, point: Vector) -> dict[str, Vector]:
    """Return what is nearest to `point` on a block's top: a node, the middles of an edge and of a face."""
    faces = faces[(nodes[faces][:, :, 2] > -1e-9).all(axis=1)]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    found = {
        "node": nodes[np.unique(faces)],
        "edge": nodes[edges].mean(axis=1),
        "face": nodes[faces].mean(axis=1),
    }
    return {name: these[np.linalg.norm(these - point, axis=1).argmin()] for name, these in found.items()}


def hanging(organ: Body, point: Vector) -> tuple[Vector, Vector]:
    """Return where a point of the resting surface (m) hangs, and the normal there into the tissue.

    The normal is the mean of those of the faces around.
    """
    rest, faces = organ.mesh.nodes, organ.touchable
    weights, away = closest_points(point, rest[faces])
    face = away.argmin()
    corners = organ.nodes[faces[away < AROUND_M]]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).sum(axis=0)
    return weights[face] @ organ.nodes[faces[face]], -areas / np.linalg.norm(areas)


def model(kind: str, body: str, nodes: int, radius: float, *, sub_grid: bool) -> PressedOrgansParams:
    """Return the organ and the probe."""
    organ, probe = {**ORGANS[body], "nodes": nodes}, {"radius": radius}
    if kind == "fem":
        return fem.params(organ, probe, sub_grid=sub_grid)
    return bullet.params(organ, probe, sub_grid=sub_grid, timestep=STEPS[nodes])


def press(
    body: str, nodes: int, radius: float, place: str, *, kind: str = "bullet", sub_grid: bool = True
) -> Press:
    """Press 1 to 6 mm deep, and rest at each depth."""
    point = np.array(TRUTH[body]["point_m"])
    rig: Rig
    with RIGS[kind](model(kind, body, nodes, radius, sub_grid=sub_grid), start=(0.0, 0.0, 0.5)) as rig:
        organ = rig.engine._organs[0]
        if place in PLACES:
            at, inward = places(organ.mesh.nodes, organ.touchable, point)[place], np.array([0.0, 0.0, -1.0])
        elif ORGANS[body] is BLOCK:
            at, inward = point, np.array([0.0, 0.0, -1.0])
        else:
            at, inward = hanging(organ, point)
        rig.at[...] = at - (radius + NEAR_M) * inward
        forces: list[float] = []
        for depth in np.arange(1, 7) * 1e-3:
            rig.move(at + (depth - radius) * inward, 0.06)
            rig.hold(PAUSE_S)
            forces.append(-float(rig.force @ inward))
        start = time.process_time()
        rig.hold(PAUSE_S)
        return Press(body, nodes, radius, place, forces, (time.process_time() - start) / PAUSE_S)


def study(kind: str, nodes: int, bodies: list[str]) -> Iterator[Press]:
    """Yield all presses on meshes of about so many nodes."""
    for body in bodies:
        for radius in TRUTH[body]["force_n"]:
            for place in PLACES if body == "middle" else ("site",):
                yield press(body, nodes, float(radius) * 1e-3, place, kind=kind)


def picture(path: Path) -> None:
    """Draw force over depth on meshes of 250 nodes: converged, with the spring, and of the mesh alone."""
    from matplotlib.figure import Figure

    bodies = [body for body in TRUTH if not body.startswith("rim")]
    figure: Any = Figure(figsize=(10, 3.5), layout="constrained")
    axes: Any = figure.subplots(1, len(bodies), sharey=True)
    for axis, body in zip(axes, bodies, strict=True):
        place = "face" if body == "middle" else "site"
        for radius, colour in (("2", "C0"), ("5", "C1")):
            if (true := TRUTH[body]["force_n"].get(radius)) is None:
                continue
            axis.plot(np.arange(1, len(true) + 1), true, color=colour, label=f"{radius} mm, converged")
            for sub_grid, mark, name in ((True, "o", "as felt"), (False, "x", "mesh alone")):
                found = press(body, 250, float(radius) * 1e-3, place, sub_grid=sub_grid).force_n[: len(true)]
                axis.plot(
                    np.arange(1, len(true) + 1),
                    found,
                    mark,
                    color=colour,
                    markersize=5,
                    label=f"{radius} mm, {name}",
                )
        axis.set_title(TRUTH[body]["title"], fontsize=9)
        axis.set_xlabel("depth, mm")
        axis.set_yscale("log")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("force, N")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, fontsize=7)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90)


def main() -> None:
    """Print the table; draw the picture where asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--kind", default="bullet", choices=list(RIGS))
    parser.add_argument("--nodes", type=int, nargs="*", default=[250, 600])
    parser.add_argument("--bodies", nargs="*", default=list(TRUTH), choices=list(ORGANS))
    args = parser.parse_args()
    for nodes in args.nodes:
        for row in study(args.kind, nodes, args.bodies):
            errors = " ".join(f"{100 * error:+6.1f}" for error in row.errors)
            where = f"{row.body:7} {row.nodes:4} nodes {row.radius_m * 1e3:.0f} mm {row.place:5}"
            print(f"{where} error, %: {errors:42} {1.0 / row.cost:.2f} times real time", flush=True)
    if args.picture:
        picture(args.picture)


if __name__ == "__main__":
    main()
