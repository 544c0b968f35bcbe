from __future__ import annotations

import sys

import pytest

from engines.mujoco import opengl


@pytest.fixture(autouse=True)
def fresh() -> None:
    opengl.find.cache_clear()


def test_what_is_found_draws() -> None:
    found = opengl.find()
    if not found.name:
        pytest.skip(f"no OpenGL: {found.detail}")
    assert found.detail  # the renderer's name
    works, detail, remedy = opengl.check()
    assert works
    assert found.detail in detail
    assert "libosmesa6" in remedy


def test_mujoco_gl_can_forbid_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    assert opengl.find() == opengl.OpenGL("", "MUJOCO_GL=disabled forbids it")


def test_mujoco_gl_is_obeyed_without_trying_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "none-such")
    found = opengl.find()
    assert not found.name
    assert found.detail.startswith("none-such: ")
    assert "egl" not in found.detail


@pytest.mark.skipif(sys.platform != "linux", reason="candidates differ")
def test_the_first_that_works_is_taken_and_all_failures_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(opengl, "_try", lambda name: (name == "osmesa", f"about {name}"))
    assert opengl.find() == opengl.OpenGL("osmesa", "about osmesa")
    opengl.find.cache_clear()
    monkeypatch.setattr(opengl, "_try", lambda name: (False, f"about {name}"))
    assert opengl.find() == opengl.OpenGL("", "egl: about egl; osmesa: about osmesa")
