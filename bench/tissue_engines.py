"""`trocar run palpation` with both tissue engines, side by side: the deepest press, and the force over time.

python bench/tissue_engines.py [FIGURE]

Prints peak force and duration of both; the duration is wall time, of one session after the other. Results:
docs/decisions/details/0125-tissue-of-our-own.md.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

import trocar
from schemas.vectors import Vector

KINDS = ("bullet", "fem")
FIGURE = "docs/pictures/tissue-engines.png"
VIEW = ["--from", "0.03,-0.05,0.022", "--at", "-0.002,0,-0.004", "--width", "900", "--height", "640"]


def palpate(kind: str, directory: Path) -> tuple[Vector, Vector]:
    """Record `palpation` with an engine; return times, s, and sizes of the force, N."""
    start = time.perf_counter()
    trocar.run("palpation", set={"participants.tissue.kind": kind}, record=str(directory / kind))
    seconds = time.perf_counter() - start
    series = trocar.Recording(directory / kind)["tissue.probe/wrench"]
    force = np.linalg.norm(series.values[:, :3], axis=1)
    print(f"{kind:6}: {seconds:5.1f} s, at most {force.max():.4f} N at {series.time[force.argmax()]:.2f} s")
    return series.time, force


def draw(recording: Path, time_s: float) -> Path:
    """Draw an instant of a recording; return the picture."""
    picture = recording.with_suffix(".png")
    command = [sys.executable, "-m", "trocar", "render", str(recording), "-o", str(picture), *VIEW]
    subprocess.run([*command, "--time", f"{time_s:.3f}"], check=True)
    return picture


def main() -> None:
    """Draw the figure."""
    mpl.use("Agg")
    from matplotlib import pyplot

    plot: Any = pyplot
    figure = plot.figure(figsize=(10.0, 6.2), layout="constrained")
    panels = figure.subplot_mosaic([list(KINDS), ["force", "force"]], height_ratios=(1.6, 1.0))
    with tempfile.TemporaryDirectory() as scratch:
        curves = {kind: palpate(kind, Path(scratch)) for kind in KINDS}
        for kind, (times, force) in curves.items():
            deepest = float(times[force.argmax()])
            panels[kind].imshow(plot.imread(draw(Path(scratch) / kind, deepest)))
            panels[kind].set(title=f"kind {kind}, {deepest:.2f} s", xticks=[], yticks=[])
            panels["force"].plot(times, force, linewidth=1.0, label=f"kind {kind}")
    panels["force"].set(xlabel="time (s)", ylabel="force on the probe (N)", xlim=(0.0, 20.0))
    panels["force"].legend(frameon=False)
    figure.savefig(sys.argv[1] if len(sys.argv) > 1 else FIGURE, dpi=110)


if __name__ == "__main__":
    main()
