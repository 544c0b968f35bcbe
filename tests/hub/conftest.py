import importlib
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hub.planning import registry
from hub.planning.scenario_file import load
from hub.session.launch import launch
from hub.session.session import Session

PENDULUM = """
from typing import Literal

import numpy as np
from pydantic import Field

from hub.participant import Params, Stepped, state_hash
from schemas.ports import Port
from schemas.quantity import Length


class Spring(Params):
    stiffness: float = Field(gt=0)


class PendulumParams(Params):
    length: Length = Field(gt=0)
    solver: Literal["euler", "verlet"] = "euler"
    springs: dict[str, Spring] = {}


class Pendulum(Stepped):
    params_model = PendulumParams

    @property
    def ports(self):
        return (
            Port(name="goal", causality="input", unit="rad", start=(0.0,)),
            Port(name="angle", causality="output", unit="rad"),
        )

    def configure(self, setup):
        self.angle = np.zeros(1)
        return {"angle": self.angle}

    def step(self, t, h, inputs):
        if self.params.length > 100.0:
            raise ArithmeticError("the rope is torn")
        self.angle = 0.5 * self.angle + 0.25 * inputs["goal"] + 1.0
        return {"angle": self.angle}

    def state_hash(self):
        return state_hash(self.angle)

    def close(self):
        pass
"""

InstallPlugin = Callable[..., None]
Prepare = Callable[..., Session]


@pytest.fixture
def install_plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[InstallPlugin]:
    """Return a function that installs a distribution for one test, with entry points and a module."""
    modules: list[str] = []

    def install(
        name: str,
        entries: dict[str, dict[str, str]],
        *,
        text: str = PENDULUM,
        requires: tuple[str, ...] = (),
        extras: tuple[str, ...] = (),
    ) -> None:
        site = tmp_path / f"site_{name}"
        info = site / f"{name}-1.0.dist-info"
        info.mkdir(parents=True)
        (site / f"{name}.py").write_text(text)
        lines = [
            "Metadata-Version: 2.1",
            f"Name: {name}",
            "Version: 1.0",
            *(f"Provides-Extra: {e}" for e in extras),
            *(f"Requires-Dist: {r}" for r in requires),
        ]
        (info / "METADATA").write_text("\n".join(lines) + "\n")
        sections = [
            f"[{group}]\n" + "".join(f"{kind} = {value}\n" for kind, value in kinds.items())
            for group, kinds in entries.items()
        ]
        (info / "entry_points.txt").write_text("\n".join(sections))
        monkeypatch.syspath_prepend(site)
        modules.append(name)
        _forget()

    _forget()
    yield install
    for module in modules:
        sys.modules.pop(module, None)
    _forget()


@pytest.fixture
def pendulum(install_plugin: InstallPlugin) -> None:
    """Install an engine of kind `pendulum`."""
    install_plugin("swing", {"trocar.engines": {"pendulum": "swing:Pendulum"}})


def _forget() -> None:
    importlib.invalidate_caches()
    registry.kinds.cache_clear()
    registry.load.cache_clear()


@pytest.fixture(scope="module")
def toys() -> Iterator[None]:
    """Let this process and its children find the participants of `toys.py`."""
    here = str(Path(__file__).parent)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(here)
        patch.setenv("PYTHONPATH", here, prepend=os.pathsep)
        yield


@pytest.fixture
def prepare(toys: None, tmp_path: Path) -> Prepare:
    """Return a function that makes a session of a scenario's text, on an endpoint of its own."""

    def prepare(text: str, *overrides: str, **options: Any) -> Session:
        file = tmp_path / "session.yaml"
        file.write_text(text)
        return launch(load(str(file), overrides), **{"endpoint": "tcp/127.0.0.1:0"} | options)

    return prepare
