"""Lens distortion, against OpenCV's formula."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.lens import NO_DISTORTION, Lens
from robots.dvrk.endoscope import StereoCamera

CAMERA = StereoCamera(160, 120)
BARREL = (-0.25, 0.06, 0.002, -0.001, 0.003)


def brown_conrady(x: np.ndarray, y: np.ndarray, k: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """As in the documentation of OpenCV's calib3d."""
    r = x**2 + y**2
    radial = 1 + k[0] * r + k[1] * r**2 + k[4] * r**3
    return (
        x * radial + 2 * k[2] * x * y + k[3] * (r + 2 * x**2),
        y * radial + k[2] * (r + 2 * y**2) + 2 * k[3] * x * y,
    )


def test_without_distortion_nothing_is_drawn_beside_the_picture() -> None:
    lens = Lens(CAMERA, NO_DISTORTION)
    assert lens.drawn == CAMERA
    picture = np.zeros((120, 160, 3), np.uint8)
    assert lens.distort(picture) is picture


@pytest.mark.parametrize("distortion", [BARREL, (0.2, 0.0, 0.0, 0.0, 0.0)])
def test_points_appear_where_the_published_coefficients_put_them(distortion: tuple[float, ...]) -> None:
    lens = Lens(CAMERA, distortion)
    drawn, (fx, cx, cy) = lens.drawn, CAMERA.intrinsics()[[0, 0, 1], [0, 2, 2]]
    assert drawn.focal_length == pytest.approx(CAMERA.focal_length)
    rows, columns = np.indices((drawn.height, drawn.width))
    middle = 0.5 * (drawn.width - 1), 0.5 * (drawn.height - 1)
    for x, y in ((0.0, 0.0), (0.3, -0.2), (-0.45, 0.3)):
        spot = np.exp(-((columns - middle[0] - fx * x) ** 2 + (rows - middle[1] - fx * y) ** 2) / 8.0)
        seen = lens.distort(np.repeat((255 * spot).astype(np.uint8)[..., None], 3, axis=2))[..., 0].astype(
            float
        )
        assert seen.shape == (120, 160)
        v, u = np.indices(seen.shape)
        found = (u * seen).sum() / seen.sum(), (v * seen).sum() / seen.sum()
        u, v = brown_conrady(np.array(x), np.array(y), distortion)
        assert found == pytest.approx((cx + fx * u, cy + fx * v), abs=0.2)


def test_a_distortion_without_inverse_is_refused() -> None:
    scene = {"arms": {"PSM1": {"position": [0.0, 0.0, 0.3]}}, "distortion": [-3.0, 0, 0, 0, 0]}
    with pytest.raises(ValidationError, match="the distortion is too strong"):
        EndoscopeParams.model_validate(scene)
