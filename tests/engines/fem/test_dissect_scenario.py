"""The installed scenario in which a sheet is burnt off its bed, as far as it takes to see that it is."""

import trocar
from schemas.trocar_msgs import TissueEvent

BURNING = {"duration": "6 s"}


def test_the_sheet_comes_off_and_the_run_is_simulated_again_to_the_bit(tmp_path):
    summary = trocar.run("dissect", set=BURNING, record=tmp_path / "run", one_host=True)
    measures = summary.measures
    assert 0.0 < measures["vaporised_m3"] < 50e-9
    assert 0.0 < measures["freed_m"] < 0.006
    assert 100.0 < measures["hottest_degC"] < 800.0
    assert measures["sheet_lost_m3"] == 0.0
    assert 0.1 < measures["pull_n"] < 2.0
    recording = trocar.Recording(tmp_path / "run")
    events = [
        event for _, event in recording["tissue.flap/events"].messages() if isinstance(event, TissueEvent)
    ]
    assert {(event.kind, event.instrument) for event in events} == {("burnt", "PSM1")}
    assert trocar.verify(tmp_path / "run").same
