"""What Bullet's damping does with the rate of a press, beside tissue that relaxes.

python bench/tissue_rates.py

Stiffness and loss tangent from 0.1 to 10 Hz: of Bullet's material as measured with a sphere that swings in a
block, and of a standard linear solid and of two branches, as `trocar calibrate tissue` fits them. Results:
docs/decisions/0095-converged-truth.md.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' rig

from schemas.vectors import Vector
from tests.engines.bullet.rig import RADIUS, SMALL_BLOCK, Rig, params

FREQUENCIES_HZ = (0.1, 1.0, 10.0)
DAMPINGS_MS = (1, 12)
"""The default, and that of the file of a press (docs/decisions/0073-calibrated-tissue.md)."""
SHARES, TIMES_S = (0.25, 0.30), (0.4, 8.0)
"""Of that press."""
DEPTH_M, AMPLITUDE_M = 2e-3, 0.2e-3


def relaxing(frequency: float, branches: int) -> complex:
    """Return the modulus over that of an instant, for the slowest `branches` of those of the press."""
    iw = 2j * np.pi * frequency
    return 1.0 - sum(
        share / (1.0 + iw * time) for share, time in [*zip(SHARES, TIMES_S, strict=True)][::-1][:branches]
    )


def measured(damping_ms: int, frequency: float) -> complex:
    """Return force over depth (N/m) of a sphere that swings, as a complex number."""
    w = 2.0 * np.pi * frequency

    def motion(t: float) -> tuple[Vector, Vector]:
        way = np.array([0.0, 0.0, -AMPLITUDE_M])
        return np.array([0.0, 0.0, RADIUS - DEPTH_M]) + way * np.sin(w * t), way * w * np.cos(w * t)

    seconds = max(1.0 / frequency, 0.4)
    with Rig(params({**SMALL_BLOCK, "damping": f"{damping_ms} ms"}), start=(0.0, 0.0, RADIUS + 1e-3)) as rig:
        rig.move((0.0, 0.0, RADIUS - DEPTH_M), 0.1)
        rig.hold(0.3)
        force = rig.follow(motion, seconds + 0.4)[400:, 2]
    # the force is the mean of a step of 1 ms
    phase = w * ((np.arange(len(force)) + 400.5) * 1e-3)
    base = np.stack([np.sin(phase), np.cos(phase), np.ones(len(phase))], axis=1)
    along, ahead, _ = np.linalg.lstsq(base, force, rcond=None)[0]
    return complex(along, ahead) / AMPLITUDE_M


def main() -> None:
    """Print the table: stiffness over that at the lowest frequency, and loss tangent."""
    rows = {f"Bullet, damping {ms} ms": [measured(ms, f) for f in FREQUENCIES_HZ] for ms in DAMPINGS_MS}
    rows["standard linear solid"] = [relaxing(f, 1) for f in FREQUENCIES_HZ]
    rows["two branches"] = [relaxing(f, 2) for f in FREQUENCIES_HZ]
    for name, found in rows.items():
        cells = "  ".join(
            f"{f:g} Hz {one.real / found[0].real:5.2f} tan {one.imag / one.real:.3f}"
            for f, one in zip(FREQUENCIES_HZ, found, strict=True)
        )
        print(f"{name:22} {cells}")


if __name__ == "__main__":
    main()
