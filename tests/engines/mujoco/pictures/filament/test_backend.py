"""Finding out whether Filament runs, without being ended by it."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.drawing import find_drawing
from engines.mujoco.pictures.filament import backend
from engines.mujoco.pictures.filament.backend import Backend
from hub.participant import Inputs, Setup
from tests.engines.mujoco.pictures.test_endoscope import PERIOD_NS, make, pixels, state

NOTHING = Backend("", False, "vulkan: no driver")


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    backend.find.cache_clear()
    yield
    backend.find.cache_clear()


def test_an_interface_that_aborts_its_process_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    works, error = backend._try("opengl", software=False)
    assert not works
    assert error


def test_all_failures_are_told_and_the_first_that_works_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(backend, "_try", lambda name, *, software: (software, f"about {name}"))
    assert backend.find() == Backend("vulkan", True, "about vulkan")
    backend.find.cache_clear()
    monkeypatch.setattr(backend, "_try", lambda name, *, software: (False, f"about {name}"))
    assert backend.find() == Backend("", False, "vulkan: about vulkan; vulkan on the CPU: about vulkan")
    works, detail, remedy = backend.check()
    assert not works
    assert "about vulkan" in detail
    assert "mesa-vulkan-drivers" in remedy


def test_the_driver_is_told() -> None:
    if not (found := backend.find()).name:
        pytest.skip(f"no Filament: {found.detail}")
    assert found.name != "vulkan" or found.detail
    assert backend.check()[1].startswith(f"Filament with {found.name}")
    assert found.detail in backend.check()[1]


@pytest.mark.parametrize(
    ("driver", "slow"),
    [
        ("llvmpipe Mesa 22.3.6 (LLVM 15.0.6)", True),
        ("llvmpipe Mesa 25.0.7-2~bpo12+1 (LLVM 15.0.6)", False),
        ("llvmpipe Mesa 23.2.1 (LLVM 15.0.7)", False),
        ("radv Mesa 22.3.6", False),
        ("NVIDIA 570.86.15", False),
    ],
)
def test_a_slow_driver_on_the_cpu_is_said(monkeypatch: pytest.MonkeyPatch, driver: str, slow: bool) -> None:
    monkeypatch.setattr(backend, "_try", lambda _name, *, software: (not software, driver))
    works, detail, _ = backend.check()
    assert works
    assert detail.startswith(f"Filament with vulkan: {driver}")
    assert ("Mesa 25 draws" in detail) == slow


def test_plain_looks_ask_for_no_filament(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "find", lambda: pytest.fail("asked"))
    for looks in (True, False, "plain"):
        assert isinstance(find_drawing(looks).engine, str)


def test_a_camera_goes_on_with_plain_looks_and_says_so(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    if not opengl.find().name:
        pytest.skip("no OpenGL")
    monkeypatch.setattr(backend, "find", lambda: NOTHING)
    with make(np.array([[0.0, 0.0, -0.1]]), looks="endoscope") as endoscope:
        with caplog.at_level(logging.WARNING):
            endoscope.configure(Setup(PERIOD_NS, Path.cwd()))
        outputs = endoscope.step(0, PERIOD_NS, Inputs({"qpos": state(endoscope)}))
    assert pixels(outputs["left/image_raw"][0]).shape == (288, 320, 3)
    (record,) = caplog.records
    assert "'endoscope' draws plain looks: Filament does not run here (vulkan: no driver)" in record.message
    assert "apt-get install mesa-vulkan-drivers" in record.message
