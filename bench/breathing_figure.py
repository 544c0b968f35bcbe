"""Draws the breathing patient of a recorded session: ventilator, motion, forces, and both books of energy.

trocar run breathing --record recordings/breathing
python bench/breathing_figure.py recordings/breathing docs/pictures/breathing.png
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from hub.recording.recording import Recording
from schemas.vectors import Vector

BOND = "patient/diaphragm"


def main() -> None:
    """Draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("picture", type=Path)
    given = parser.parse_args()
    recording = Recording(given.recording)

    def patient(name: str) -> tuple[Vector, Vector]:
        series = recording[f"patient.{name}"]
        return series.time, series.values[:, 0]

    book = np.array(
        [(ns * 1e-9, entry.motion_work_j, entry.residual_j) for ns, entry in recording.energy(BOND)]
    )
    figure: Any = Figure(figsize=(11, 3.4), layout="constrained")
    breath, way, account, residual = figure.subplots(1, 4)
    time, pressure = patient("pressure")
    breath.plot(time, 1e-2 * pressure, linewidth=1.0, label="pressure, hPa")
    breath.plot(time, 1e5 * patient("volume")[1], linewidth=1.0, label="volume, 10 ml")
    breath.set(xlabel="time, s", ylabel="above the end of expiration")
    way.plot(time, 1e3 * patient("excursion")[1], linewidth=1.0, label="diaphragm, mm")
    probe = recording["tissue.PSM1/wrench"]
    way.plot(
        probe.time, 20.0 * np.linalg.norm(probe.values[:, :3], axis=1), linewidth=1.0, label="probe, 50 mN"
    )
    way.set(xlabel="time, s", ylabel="motion, and force on the probe")
    names = ("by_ventilator", "lost", "stored", "to_organ")
    energies = [patient(name)[1] for name in names]
    for name, values in zip(("from the ventilator", "lost", "stored"), energies, strict=False):
        account.plot(time, values, linewidth=1.0, label=name)
    account.set(xlabel="time, s", ylabel="energy, J")
    residual.plot(book[:, 0], 1e6 * book[:, 2], linewidth=1.0, label="bond")
    balance = energies[0] - energies[1] - energies[2] - energies[3]
    residual.plot(time, 1e6 * balance, linewidth=1.0, label="patient")
    residual.set(xlabel="time, s", ylabel="error of the books, uJ")
    for axis in (breath, way, account, residual):
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8)
    figure.savefig(given.picture, dpi=110)
    error, exchanged = np.abs(book[:, 2]).max(), np.abs(np.diff(book[:, 1])).sum()
    print(f"bond: {exchanged:.4g} J exchanged, error {error:.2g} J, {book[-1, 1]:.9g} J on the patient")
    print(f"patient: error {np.abs(balance).max():.2g} J, {energies[3][-1]:.9g} J on the organ")


if __name__ == "__main__":
    main()
