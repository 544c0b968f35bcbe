"""The breathing patient: a held force, its account of energy, and its state."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import configs
from engines.fmu.engine import FmuEngine, FmuParams
from hub.participant import Setup
from schemas.errors import SessionError
from tests.engines.fmu.driving import MS, inputs_of
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

PATIENT = Path(configs.__file__).parent / "data" / "breathing"


@pytest.fixture
def patient(tmp_path: Path) -> Iterator[Any]:
    engines: list[FmuEngine] = []

    def make(**start: float) -> FmuEngine:
        engines.append(FmuEngine("patient", FmuParams(path=PATIENT, start=start)))
        engines[-1].configure(Setup(period_ns=2 * MS, directory=tmp_path))
        return engines[-1]

    yield make
    for engine in engines:
        engine.close()


def breathe(engine: FmuEngine, seconds: float, begin: float = 0.0, **inputs: float) -> list[dict[str, float]]:
    first, last = round(begin * 500), round((begin + seconds) * 500)
    given = inputs_of(engine, **inputs)
    rows: list[dict[str, float]] = []
    for k in range(first, last):
        outputs: Any = engine.step(2 * k * MS, 2 * MS, given)
        rows.append({name: float(value[0]) for name, value in outputs.items()})
    return rows


def test_a_breath_of_an_adult_at_rest(patient: Any) -> None:
    rows = breathe(patient(), 5.0)
    assert 4.5e-4 < max(row["volume"] for row in rows) < 6.5e-4
    assert 8e-3 < max(row["excursion"] for row in rows) < 11e-3
    assert rows[-1]["excursion"] < 1e-4  # expiration ends


def test_its_account_of_energy_is_closed_with_a_force_in_any_direction(patient: Any) -> None:
    rows = breathe(patient(direction_x=0.6, direction_z=0.8), 5.0, force_x=-1.0, force_y=3.0, force_z=2.0)
    for row in rows:
        balance = row["by_ventilator"] - row["stored"] - row["lost"] - row["to_organ"]
        assert abs(balance) < 1e-11
        force = -1.0 * row["position_x"] + 2.0 * row["position_z"]
        assert row["to_organ"] == pytest.approx(-force, abs=1e-12)
        assert row["position_y"] == 0.0


def test_a_saved_state_goes_on_in_every_bit(patient: Any) -> None:
    engine = patient()
    breathe(engine, 1.0, force_x=-2.0)
    saved = engine.save()
    expected = breathe(engine, 1.0, 1.0, force_x=-1.0)
    engine.restore(saved)
    assert breathe(engine, 1.0, 1.0, force_x=-1.0) == expected


@pytest.mark.parametrize("start", [{"direction_x": 0.5}, {"mass": 0.0}, {"inspiration": 0.97}])
def test_a_patient_that_cannot_be(patient: Any, start: dict[str, float]) -> None:
    with pytest.raises(SessionError, match="fmi2ExitInitializationMode returned 'error'"):
        patient(**start)


def test_the_plateau_is_that_of_the_springs(patient: Any) -> None:
    """Held long, all compliances stand in series with the pressure: V / C + U / B = p, A U / B = k x."""
    row = breathe(patient(rate=0.01, inspiration=0.9), 60.0)[-1]
    area, stiffness, lung, ribs = 0.025, 900.0, 1e-6, 1e-6
    pleura = stiffness * row["excursion"] / area
    assert row["volume"] / lung + pleura == pytest.approx(1000.0, rel=1e-3)
    assert row["volume"] - area * row["excursion"] == pytest.approx(ribs * pleura, rel=1e-3)
    assert np.isclose(row["pressure"], 1000.0)
