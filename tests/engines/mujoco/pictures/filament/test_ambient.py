"""The colour of light from all sides, in the environment's file."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np

from engines.mujoco.pictures.filament.ambient import tinted_environment

FILE = Path(mujoco.__file__).parent / "studio" / "assets" / "ibl.ktx"
HEADER, TEXT = 64, 260
"""Bytes before the harmonics, and of them, in the file of MuJoCo 4.0."""


def harmonics(file: bytes) -> np.ndarray:
    text = file[HEADER + 4 : HEADER + 4 + TEXT].removeprefix(b"sh\0").decode()
    return np.array([[float(one) for one in line.split()] for line in text.splitlines()])


def test_matt_surfaces_are_tinted_and_reflections_stay() -> None:
    before = FILE.read_bytes()
    for colour in ((1.0, 1.0, 1.0), (1.25, 0.88, 0.79), (0.123456, 1.98765, 1.0)):
        after = tinted_environment(before, colour)
        assert len(after) == len(before)
        assert after[HEADER + 4 + TEXT :] == before[HEADER + 4 + TEXT :]
        assert after[: HEADER + 4] == before[: HEADER + 4]
        expected = harmonics(before) * colour
        assert np.allclose(harmonics(after), expected, rtol=1e-3, atol=1e-4)
