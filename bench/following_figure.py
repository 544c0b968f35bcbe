"""Draws how instruments follow simulated masters over time: setpoints and measured tips of `system`.

trocar run system --set console.scale=1 --record recordings/system
python bench/following_figure.py recordings/system docs/pictures/following.png --scale 1
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from matplotlib.figure import Figure

from hub.recording.recording import Recording
from robots import rotation
from schemas.ros import BoolMessage
from schemas.vectors import Vector

SIDES = (("right", "MTMR", "PSM1"), ("left", "MTML", "PSM2"))


class Errors(NamedTuple):
    """Distance (mm) and angle (degrees) of a tip from where its master leads it."""

    time: Vector
    distance: Vector
    angle: Vector


def begin_of(recording: Recording, hand: str) -> float:
    """Return when the instrument has begun to follow for good, s."""
    told = list(recording[f"{hand}.following"].messages())
    return max(at for at, message in told if not cast("BoolMessage", message).data)


def errors_of(recording: Recording, names: tuple[str, str, str], scale: float, kind: str) -> Errors:
    """Return the errors of the tip, `kind` setpoint or measured, at the times of its states."""
    hand, master, arm = names
    leads, led = recording[f"masters.{master}/measured_cp"], recording[f"motion.{arm}/{kind}_cp"]
    begin = begin_of(recording, hand)
    _, first, second = np.intersect1d(leads.time.round(6), led.time.round(6), return_indices=True)
    after = led.time[second] > begin + 0.02
    x, p, time = leads.values[first][after], led.values[second][after], led.time[second][after]
    start = recording[f"motion.{arm}/setpoint_cp"].values[second][after][0]
    wanted = start[:3] + scale * (x[:, :3] - x[0, :3])
    offset = rotation.product(rotation.conjugate(x[0, 3:]), start[3:])
    turned = [
        rotation.product(rotation.conjugate(rotation.product(m[3:], offset)), t[3:])
        for m, t in zip(x, p, strict=True)
    ]
    angles = np.array([np.linalg.norm(rotation.log(q)) for q in turned])
    return Errors(time, 1e3 * np.linalg.norm(p[:, :3] - wanted, axis=1), np.degrees(angles))


def main() -> None:
    """Draw, and print the largest errors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("picture", type=Path)
    parser.add_argument("--scale", type=float, default=0.2)
    given = parser.parse_args()
    recording = Recording(given.recording)
    figure: Any = Figure(figsize=(9, 4.6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    for column, names in enumerate(SIDES):
        for kind in ("measured", "setpoint"):
            found = errors_of(recording, names, given.scale, kind)
            for axis, values in zip(axes[:, column], (found.distance, found.angle), strict=True):
                axis.plot(found.time, values, linewidth=0.9, label=f"{kind}, at most {values.max():.3f}")
        axes[0, column].set(title=f"{names[1]} leads {names[2]}", ylabel="distance, mm" if not column else "")
        axes[1, column].set(xlabel="time, s", ylabel="angle, degrees" if not column else "")
    for axis in axes.flat:
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    figure.savefig(given.picture, dpi=100)


if __name__ == "__main__":
    main()
