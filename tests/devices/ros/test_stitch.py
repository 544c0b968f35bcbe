"""A program guides a stitch over each gateway: picks, sees the path, consents, pauses and resumes."""

import re

import pytest
import yaml

from hub.planning.scenario_file import installed_scenarios
from schemas.ros import Header, Point, PointStamped, StringMessage
from schemas.visualization import MarkerAction
from tests.devices.ros.any_gateway import middleware, rclpy_python

__all__ = ["middleware", "rclpy_python"]

pytest.importorskip("mujoco")


def scenario():
    """The scenario `suturing-by-hand` without a camera."""
    tree = yaml.safe_load(installed_scenarios()["suturing-by-hand"].read_text())
    del tree["participants"]["endoscope"]
    tree["order"].remove("endoscope")
    tree["connections"] = [one for one in tree["connections"] if "endoscope" not in one]
    return tree


class Surgeon:
    """A program that guides a stitch."""

    def __init__(self, peer, rows):
        self.peer, self.rows = peer, rows
        peer.join(list(rows.values()))

    def pick(self, x, y, frame="phantom"):
        point = PointStamped(header=Header(frame_id=frame), point=Point(x=x, y=y))
        self.peer.send(self.rows["/stitch/pick"], point)

    def say(self, word):
        self.peer.send(self.rows["/stitch/command"], StringMessage(data=word))

    def hears(self, topic, text):
        """Wait until a text is heard, and return all of it."""
        heard = ""
        while text not in heard:
            heard = self.peer.heard(self.rows[topic], 60.0).data
        return heard

    def sees(self):
        """Wait until the path is shown, and return the names of what is shown with it."""
        while True:
            markers = self.peer.heard(self.rows["/stitch/markers"], 60.0).markers
            shown = {marker.ns for marker in markers if marker.action != MarkerAction.DELETE}
            if "stitch/path" in shown:
                return shown


def in_turn(peer, rows):
    surgeon = Surgeon(peer, rows)
    surgeon.hears("/stitch/state", "PICKING")
    surgeon.pick(0.081, 0.0, "nowhere")
    surgeon.hears("/stitch/status", "frame_id 'nowhere' is no frame of this scene")
    surgeon.pick(0.008, 0.018)
    surgeon.pick(-0.008, 0.018)
    surgeon.hears("/stitch/state", "PROPOSED")
    assert {"stitch/entry", "stitch/exit", "stitch/disc", "stitch/banner"} <= surgeon.sees()
    proposal = re.search(r"consent (\w{8})\?", surgeon.hears("/stitch/status", "PSM"))[1]
    surgeon.say("consent 00000000")
    surgeon.hears("/stitch/status", f"a consent to '00000000', but '{proposal}' is proposed")
    surgeon.say(f"consent {proposal}")
    for word, stage in (("pause", "PAUSED"), ("resume", "RUNNING"), ("take over", "TAKEN_OVER")):
        surgeon.say(word)
        surgeon.hears("/stitch/state", stage)
    surgeon.say("resume")
    surgeon.hears("/stitch/state", "RUNNING")


@pytest.mark.long
def test_a_program_guides_a_stitch(middleware):
    middleware.run(scenario(), {"stitch"}, in_turn)
