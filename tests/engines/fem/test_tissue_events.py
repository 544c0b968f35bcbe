"""Events of tissue: changes in a row are one event, with place, size and instrument."""

import numpy as np
import pytest

from engines.fem.tissue_events import TissueEvents
from tests.engines.fem.test_cut import engine_in_mid_cut
from tests.engines.fem.test_engine import CLOSED, Jaw

MS = 1_000_000


def add(events, kind, size, place, sphere):
    events.add(kind, np.array([size]), np.array([place]), np.array([sphere]))


def run(events, start_ms, end_ms):
    return [one for t in range(start_ms, end_ms) for one in events.finish(t * MS)]


def test_changes_in_a_row_are_one_event_at_their_mean_place():
    events = TissueEvents(["scissors", "scissors"])
    add(events, "cut", 1e-6, [0.0, 0.0, 0.0], 0)
    assert run(events, 10, 60) == []
    add(events, "cut", 3e-6, [4e-3, 0.0, 0.0], 1)
    (event,) = run(events, 60, 500)
    assert (event.kind, event.instrument, event.unit) == ("cut", "scissors", "m^2")
    assert event.size == pytest.approx(4e-6)
    assert event.position.x == pytest.approx(3e-3)
    assert event.header.stamp.ns == 60 * MS
    assert event.header.frame_id == "world"
    assert run(events, 500, 600) == []


def test_a_long_change_is_told_every_half_second():
    events, found = TissueEvents(["hook"]), []
    for t in range(0, 2000, 10):
        add(events, "burnt", 1e-9, [0.0, 0.0, 0.0], 0)
        found += events.finish(t * MS)
    assert [one.header.stamp.ns // MS for one in found] == [500, 1010, 1520]
    assert sum(one.size for one in found) == pytest.approx(153e-9)


def test_instruments_and_kinds_have_events_of_their_own():
    events = TissueEvents(["left", "right"])
    for kind, sphere in (("cut", 1), ("cut", 0), ("torn", -1)):
        add(events, kind, 1e-6, [0.0, 0.0, 0.0], sphere)
    found = [(one.kind, one.instrument) for one in run(events, 0, 200)]
    assert found == [("cut", "left"), ("cut", "right"), ("torn", "")]


def test_a_gathered_event_is_saved_and_restored():
    events, other = TissueEvents(["left"]), TissueEvents(["left"])
    add(events, "cut", 1e-6, [1e-3, 0.0, 0.0], 0)
    events.finish(0)
    other.restore(iter([array.tobytes() for array in events.state]))
    assert run(other, 1, 200) == run(events, 1, 200) != []


def test_a_blade_that_has_gone_through_is_an_event_of_its_area():
    with engine_in_mid_cut() as rig:
        found = []
        for _ in range(120):
            rig.hold(1e-3)
            found += rig.outputs["block/events"]
    (event,) = found
    assert (event.kind, event.instrument) == ("cut", "probe")
    # 13 of 30 mm, 5 mm deep, by faces of some 3 mm
    assert event.size == pytest.approx(13e-3 * 5e-3, rel=0.35)
    place = event.position
    assert (place.x, place.y, place.z) == pytest.approx((-8.5e-3, 1.3e-3, -2.5e-3), abs=2e-3)


def test_tissue_that_is_pulled_apart_is_torn_by_the_instrument_that_holds_it():
    cutting = {"toughness": "30 J/m^2", "tear_stretch": 1.3}
    jaw = Jaw({"cutting": cutting}, hold="50 N").take()
    jaw.go(CLOSED, (9e-3, 2e-3), 0.2).go((9e-3, 2e-3), (9e-3, 2e-3), 0.4)
    assert {(one.kind, one.instrument) for one in jaw.tissue_events} == {("torn", "probe")}
    assert sum(one.size for one in jaw.tissue_events) > 1e-6


def test_an_organ_that_cannot_change_has_no_events():
    assert "block/events" not in Jaw().outputs
