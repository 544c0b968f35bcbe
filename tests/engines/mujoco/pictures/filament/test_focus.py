"""Blur by distance."""

from __future__ import annotations

import numpy as np

from engines.mujoco.pictures.filament.focus import blur

STRIPES = np.where((np.arange(120) // 3 % 2 == 0)[None, :, None], 220, 40) * np.ones((96, 1, 3))
PICTURE = STRIPES.astype(np.uint8)


def test_what_is_in_focus_stays_as_it_is() -> None:
    assert np.array_equal(blur(PICTURE, np.zeros((96, 120), np.float32)), PICTURE)


def test_contrast_falls_with_the_distance_from_focus_on_both_sides() -> None:
    for side in (-1.0, 1.0):
        widths = [np.full((96, 120), side * width, np.float32) for width in (0.5, 1.0, 2.0, 4.0, 40.0)]
        contrast = [float(blur(PICTURE, width)[:, 20:-20].std()) for width in widths]
        assert contrast[:4] == sorted(contrast[:4], reverse=True)
        assert contrast[-1] < 0.05 * PICTURE.std()
        assert abs(float(blur(PICTURE, widths[-1]).mean()) - PICTURE.mean()) < 2.0


def test_a_near_thing_is_blurred_over_its_edge_and_a_far_one_is_not() -> None:
    widths = np.zeros((96, 120), np.float32)
    widths[:, :60] = 4.0
    edge = np.s_[:, 62:68]
    near, far = blur(PICTURE, widths), blur(PICTURE, -widths)
    assert near[edge].std() < 0.8 * PICTURE[edge].std()
    assert np.array_equal(far[edge], PICTURE[edge])
