"""Loss of light in the corners, noise, and automatic light."""

from __future__ import annotations

import numpy as np
import pytest

from engines.mujoco.pictures.filament.light_control import LightControl
from engines.mujoco.pictures.filament.sensor import Sensor
from engines.mujoco.pictures.sensor_params import SensorParams

GREY = np.full((96, 120, 3), 128, np.uint8)


def test_everything_off_is_the_truth() -> None:
    sensor = Sensor(SensorParams(vignette=0.0, noise=0.0), 120, 96)
    assert np.array_equal(sensor.expose(GREY), GREY)


def test_corners_are_darker_and_the_middle_is_not() -> None:
    picture = Sensor(SensorParams(vignette=0.4, noise=0.0), 120, 96).expose(GREY)
    assert picture[48, 60].tolist() == [128] * 3
    assert picture[0, 0, 0] == pytest.approx(0.6 * 128, abs=2)


def test_noise_has_no_bias_grows_with_light_and_differs_between_pictures() -> None:
    sensor = Sensor(SensorParams(vignette=0.0, noise=3.0), 120, 96)
    one, other = sensor.expose(GREY), sensor.expose(GREY)
    assert abs(float(one.mean()) - 128.0) < 0.5
    assert not np.array_equal(one, other)
    assert one.std() > 1.3 * sensor.expose(GREY // 4).std()


@pytest.mark.parametrize("start", [40, 100, 240])
def test_light_settles_where_tissue_has_its_brightness(start: int) -> None:
    """The picture answers to light with a power, as behind a tone curve."""
    control = LightControl()

    def picture() -> np.ndarray:
        level = min(start * control.factor ** (1.0 / 1.8), 255.0)
        return np.full((60, 80, 3), level).astype(np.uint8)

    for _ in range(60):
        control.follow(picture())
    assert 100.0 < picture().mean() < 125.0


def test_light_follows_with_a_lag() -> None:
    control = LightControl()
    assert control.follow(np.full((60, 80, 3), 50, np.uint8))
    assert 1.0 < control.factor < 2.5
