"""Figures of a needle in tissue, from the ports that a suturing pad has, and of events of tissue."""

import numpy as np
import pytest

from hub.recording.report_tissue import tissue_figures
from schemas.ros import Header
from schemas.trocar_msgs import TissueEvent

WAY = np.array([0, 0, 1, 2, 3, 4, 0, 0, 0, 1, 2, 0], float) * 1e-3
FORCE = np.array([0, 0.8, 0.3, 0.3, 0.7, 0, 0, 0.2, 0, 0.3, 0.9, 0])


class Series:
    def __init__(self, values):
        self.time, self.values = np.arange(len(values)) * 1e-3, np.array(values)[:, None]


class Recorded(dict):
    @property
    def ports(self):
        return dict.fromkeys(self, "std_msgs/msg/Float64")


@pytest.fixture
def recording():
    return Recorded(
        {
            "pad.insertion": Series(WAY),
            "pad.tip_force": Series(FORCE),
            "pad.trauma": Series(WAY * 1e-3),
            "other.trauma": Series(WAY),
        }
    )


def test_it_has_the_force_over_the_way_of_every_insertion_and_the_trauma(recording):
    force, trauma = tissue_figures(recording)
    assert (force.title, trauma.title) == ("pad: force on the tip", "pad: trauma")
    assert "2 times in" in force.caption  # a touch that does not go in is none
    assert "At most 0.9 N" in force.caption
    assert "At most 4 mm" in trauma.caption


def test_a_needle_that_was_never_in_has_no_figure(recording):
    recording["pad.insertion"] = recording["pad.trauma"] = Series(0 * WAY)
    assert not list(tissue_figures(recording))


class Events:
    def messages(self):
        for t, kind, size, unit in (
            (1.0, "cut", 2e-6, "m^2"),
            (2.0, "cut", 3e-6, "m^2"),
            (2.5, "burnt", 1e-9, "m^3"),
        ):
            yield t, TissueEvent(header=Header(), kind=kind, size=size, unit=unit)


def test_events_of_tissue_are_summed_by_kind():
    class Changed(Recorded):
        @property
        def ports(self):
            return dict.fromkeys(self, TissueEvent.ros_type)

    cut, burnt = tissue_figures(Changed({"tissue.liver/events": Events()}))
    assert (cut.title, cut.caption) == ("tissue.liver: cut", "5 mm² cut, 2 times.")
    assert (burnt.title, burnt.caption) == ("tissue.liver: burnt", "1 mm³ burnt, 1 time.")
