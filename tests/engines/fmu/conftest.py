"""Engines of the test FMUs, which are compiled once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from engines.fmu.engine import FmuEngine, FmuParams
from hub.participant import Setup
from tests.engines.fmu.driving import BALL, MS, SPRING, STAIR, Make
from tests.engines.fmus import build


@pytest.fixture(scope="session")
def libraries(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return {
        model: build.compile_library(model, tmp_path_factory.mktemp(model)) for model in (SPRING, BALL, STAIR)
    }


@pytest.fixture
def make(libraries: dict[str, Path], tmp_path: Path) -> Iterator[Make]:
    """Makes an engine of a test FMU, configured unless `period` is 0."""
    engines: list[FmuEngine] = []

    def make(model: str, period: int = MS, edits: dict[str, str] | None = None, **params: Any) -> FmuEngine:
        path = build.pack(model, libraries[model], tmp_path / f"{model}{len(engines)}.fmu", edits)
        engines.append(FmuEngine("plant", FmuParams(path=path, **params)))
        if period:
            engines[-1].configure(Setup(period_ns=period, directory=tmp_path))
        return engines[-1]

    yield make
    for engine in engines:
        engine.close()
