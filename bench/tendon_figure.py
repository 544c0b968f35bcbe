"""Draws the tendon drive of a recorded session: force over motion, and its account of energy.

trocar run tendon --record recordings/tendon
python bench/tendon_figure.py recordings/tendon docs/pictures/tendon.png
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from hub.recording.recording import Recording
from schemas.vectors import Vector

BOND = "robot/PSM1/insertion"


def read(recording: Recording, *ports: str) -> tuple[Vector, list[Vector]]:
    """Return time (s) and values of scalar ports of the drive or the robot's joint."""
    series = [recording[port] for port in ports]
    return series[0].time, [one.values[:, 0] for one in series]


def main() -> None:
    """Draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("picture", type=Path)
    given = parser.parse_args()
    recording = Recording(given.recording)
    outputs = [f"drive.{name}" for name in ("stretch", "force", "motor_position", "motor_force")]
    _, (stretch, force, motor, motor_force) = read(recording, *outputs)
    time, energies = read(
        recording, *[f"drive.{name}" for name in ("by_motor", "lost", "stored", "to_joint")]
    )
    book = np.array([(ns * 1e-9, entry.residual_j) for ns, entry in recording.energy(BOND)])
    figure: Any = Figure(figsize=(11, 3.4), layout="constrained")
    cable, loop, account, residual = figure.subplots(1, 4)
    cable.plot(1e3 * stretch, force, linewidth=0.8)
    cable.set(xlabel="motor ahead of the joint, mm", ylabel="cable's force on the joint, N")
    loop.plot(1e3 * motor, motor_force, linewidth=0.8, color="C1", label="motor")
    loop.plot(1e3 * motor, force, linewidth=0.8, color="C0", label="joint")
    loop.set(xlabel="motor's way at the cable, mm", ylabel="force, N")
    loop.legend(fontsize=8)
    for name, values in zip(("from the motor", "lost", "stored", "to the joint"), energies, strict=True):
        account.plot(time, 1e3 * values, linewidth=1.0, label=name)
    account.set(xlabel="time, s", ylabel="energy, mJ")
    account.legend(fontsize=8)
    balance = energies[0] - energies[1] - energies[2] - energies[3]
    residual.plot(book[:, 0], 1e6 * book[:, 1], linewidth=1.0, label="bond")
    residual.plot(time, 1e6 * balance, linewidth=1.0, label="drive")
    residual.set(xlabel="time, s", ylabel="error of the books, uJ")
    residual.legend(fontsize=8)
    for axis in (cable, loop, account, residual):
        axis.grid(alpha=0.3)
    figure.savefig(given.picture, dpi=110)


if __name__ == "__main__":
    main()
