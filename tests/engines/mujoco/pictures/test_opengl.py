from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

from engines.mujoco.pictures import opengl
from tests.waiting import LIMIT_S


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    """What is found in these tests is neither that of others nor left to others."""
    opengl.find.cache_clear()
    yield
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


@pytest.mark.parametrize("asked", ["none-such", "egl", None])
def test_mujoco_is_imported_whatever_mujoco_gl_asks_for(asked: str | None) -> None:
    environment = {key: value for key, value in os.environ.items() if key != "MUJOCO_GL"} | (
        {} if asked is None else {"MUJOCO_GL": asked}
    )
    what = (
        "import os\nfrom engines.mujoco.pictures.opengl import import_mujoco\nimport_mujoco()\nimport"
        " mujoco\nprint(mujoco.MjData, os.environ.get('MUJOCO_GL'))"
    )
    done = subprocess.run(
        [sys.executable, "-P", "-c", what],
        env=environment,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith(f"MjData'> {asked}\n")


@pytest.mark.long
def test_a_session_runs_where_mujoco_gl_names_what_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "none-such")
    what = [
        "-m",
        "hub.command_line",
        "run",
        "cart",
        "--one-host",
        "--set",
        "duration=5 ms",
        "--set",
        "participants.robot.looks=false",
    ]
    done = subprocess.run(
        [sys.executable, "-P", *what], capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "publishes no pictures" in done.stderr
    assert "apt-get install libosmesa6" in " ".join(done.stderr.split())
