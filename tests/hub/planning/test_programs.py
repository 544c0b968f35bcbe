"""Scenarios that are opened to programs."""

import pytest

from hub.planning.scenario_file import load
from schemas.errors import ScenarioError


def kinds(loaded):
    return [spec.kind for spec in loaded.scenario.participants.values()]


@pytest.mark.parametrize("name", ["hand-over", "palpation", "peg-board", "psm", "ros", "teleop"])
def test_a_scenario_with_a_motion_controller_gets_one_gateway(name):
    if "motion" not in kinds(load(name)):
        with pytest.raises(ScenarioError, match="no participant of kind motion"):
            load(name, programs=True)
        return
    opened = load(name, programs=True)
    assert sum(kind in ("programs", "ros2-zenoh") for kind in kinds(opened)) == 1
    assert opened.params.keys() == opened.scenario.participants.keys()


def test_pictures_are_connected_where_there_are_any():
    def sources(name):
        return [str(connection.source) for connection in load(name, programs=True).scenario.connections]

    assert "endoscope.*" in sources("suturing")
    assert "endoscope.*" not in sources("retraction")


def test_a_frame_of_reference_is_the_controller_s():
    assert load("needle-tracking", programs=True).params["programs"].reference == "base"
