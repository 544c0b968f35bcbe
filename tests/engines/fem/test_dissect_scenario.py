"""The installed scenario in which a sheet is burnt off its bed, as far as it takes to see that it is."""

import pytest

import trocar
from schemas.trocar_msgs import TissueEvent

BURNING = {"duration": "5 s"}


@pytest.mark.search
def test_the_sheet_comes_off_and_the_run_is_simulated_again_to_the_bit(tmp_path):
    summary = trocar.run("dissect", set=BURNING, record=tmp_path / "run", one_host=True)
    measures = summary.measures
    assert 2e-6 < measures["freed_m2"] < 25e-6
    assert 90.0 < measures["hottest_degC"] < 500.0
    assert 0.0 < measures["below_dead_m3"] < 200e-9
    assert 0.0 < measures["pull_n"] < 2.5
    recording = trocar.Recording(tmp_path / "run")
    events = [
        (event.kind, event.instrument)
        for organ in ("sheet", "bed")
        for _, event in recording[f"tissue.{organ}/events"].messages()
        if isinstance(event, TissueEvent)
    ]
    assert set(events) == {("burnt", "PSM1"), ("detached", "PSM1")}
    assert trocar.verify(tmp_path / "run").same
