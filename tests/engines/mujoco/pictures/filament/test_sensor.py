"""Loss of light in the corners, noise, and automatic light."""

from __future__ import annotations

import numpy as np
import pytest

from engines.mujoco.pictures.filament import sensor
from engines.mujoco.pictures.filament.light_control import LightControl
from engines.mujoco.pictures.filament.sensor import Sensor
from engines.mujoco.pictures.sensor_params import SensorParams

GREY = np.full((96, 120, 3), 128, np.uint8)


def test_everything_off_is_the_truth() -> None:
    camera = Sensor(SensorParams(vignette=0.0, noise=0.0), 120, 96)
    assert np.array_equal(camera.expose(GREY, 0, 0), GREY)


def test_corners_are_darker_and_the_middle_is_not() -> None:
    picture = Sensor(SensorParams(vignette=0.4, noise=0.0), 120, 96).expose(GREY, 0, 0)
    assert picture[48, 60].tolist() == [128] * 3
    assert picture[0, 0, 0] == pytest.approx(0.6 * 128, abs=2)


def test_noise_has_no_bias_grows_with_light_and_differs_between_pictures() -> None:
    camera = Sensor(SensorParams(vignette=0.0, noise=3.0), 120, 96)
    one, other = camera.expose(GREY, 0, 0), camera.expose(GREY, 40_000_000, 0)
    assert abs(float(one.mean()) - 128.0) < 0.5
    assert not np.array_equal(one, other)
    assert not np.array_equal(one, camera.expose(GREY, 0, 1))
    assert np.array_equal(one, camera.expose(GREY, 0, 0))  # drawn again
    assert one.std() > 1.3 * camera.expose(GREY // 4, 0, 0).std()


def test_a_warm_balance_is_red_and_automatic_balance_removes_most_of_a_cast() -> None:
    warm = Sensor(SensorParams(vignette=0.0, noise=0.0, warmth=1.0), 120, 96).expose(GREY, 0, 0)[48, 60]
    assert warm[0] / warm[2] == pytest.approx(2.0, abs=0.03)
    balanced = Sensor(SensorParams(vignette=0.0, noise=0.0, white_balance="automatic"), 120, 96)
    cast = np.full_like(GREY, (200, 120, 80))
    first = balanced.expose(cast, 0, 0)[48, 60].astype(float)
    for _ in range(80):
        last = balanced.expose(cast, 0, 0)[48, 60].astype(float)
    assert first[0] / first[2] > 2.2  # a lag
    assert last[0] / last[2] < 1.5


def test_fog_takes_contrast_until_it_is_wiped_and_dirt_darkens_places() -> None:
    stripes = np.where((np.arange(120) // 8 % 2 == 0)[None, :, None], 220, 30) * np.ones((96, 1, 3))
    stripes = stripes.astype(np.uint8)
    event = {"time": "1 s", "duration": "0.5 s"}
    params = {
        "vignette": 0,
        "noise": 0,
        "fog": 0.9,
        "events": [event | {"fog": 0.0}, event | {"time": "3 s", "dirt": 1.0}],
    }
    camera = Sensor(SensorParams.model_validate(params), 120, 96)
    contrast = [float(camera.expose(stripes, round(1e9 * t), 0).std()) for t in (0.0, 1.25, 2.0)]
    assert contrast[0] < 0.8 * contrast[1]
    assert contrast[1] < 0.9 * contrast[2]
    assert np.array_equal(camera.expose(stripes, 2_000_000_000, 0), stripes)
    smeared = [camera.expose(GREY, 4_000_000_000, eye).astype(int) for eye in (0, 1)]
    assert (smeared[0] < 100).any()
    assert (smeared[0] == 128).any()
    assert not np.array_equal(smeared[0], smeared[1])


def test_a_video_link_loses_fine_colours() -> None:
    squares = np.indices((96, 120)).sum(axis=0) % 2
    picture = np.where(squares[..., None] == 0, (200, 60, 60), (60, 60, 200)).astype(np.uint8)
    sent = Sensor(SensorParams(vignette=0.0, noise=0.0, compression=70), 120, 96).expose(picture, 0, 0)
    assert sent.shape == picture.shape
    assert np.abs(sent[..., 0].astype(int) - sent[..., 2]).mean() < 60


@pytest.mark.parametrize("params", [{}, {"noise": 0.0}, {"noise": 8.0, "warmth": 0.6, "vignette": 1.0}])
def test_compiled_and_arrays_give_the_same_picture(
    params: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    if sensor.compiled is None:
        pytest.skip("no C compiler")
    drawn = np.random.default_rng(0).integers(0, 256, (96, 120, 4), np.uint8)[:, :, :3]  # a row has gaps
    one = Sensor(SensorParams(white_balance="automatic", **params), 120, 96)
    other = Sensor(SensorParams(white_balance="automatic", **params), 120, 96)
    for time in (0, 40_000_000):
        fast = one.expose(drawn, time, 0)
        with monkeypatch.context() as patched:
            patched.setattr(sensor, "_expose", sensor.expose_by_arrays)
            assert np.array_equal(other.expose(drawn, time, 0), fast)


def test_arrays_of_another_size_are_refused() -> None:
    if sensor.compiled is None:
        pytest.skip("no C compiler")
    light, gains = np.ones(GREY.shape, np.float32), np.ones(3 * 120, np.float32)
    for wrong in (GREY[:-1], GREY[:, 1:], GREY[..., :2], GREY[::1, ::1, ::-1]):
        with pytest.raises(ValueError, match="sizes"):
            sensor.compiled.expose(wrong, light, gains, None, 0.0, np.empty_like(GREY))
    with pytest.raises(ValueError, match="sizes"):
        sensor.compiled.expose(GREY, light, gains, light[1:], 0.0, np.empty_like(GREY))


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
