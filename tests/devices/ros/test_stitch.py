"""A real program on rclpy guides a stitch: picks, sees the path, consents, pauses and resumes."""

from concurrent.futures import ThreadPoolExecutor

import pytest
import yaml

from devices.ros.dds.gateway import DdsGateway
from hub.planning.scenario_file import installed_scenarios, load
from hub.session.launch import launch
from schemas.ros import Header, Point, PointStamped, StringMessage
from tests.devices.ros.rclpy_environment import rclpy_python
from tests.devices.ros.rclpy_peer import RclpyPeer, free_domain

__all__ = ["rclpy_python"]

pytest.importorskip("cyclonedds")
pytest.importorskip("mujoco")


def scenario(domain):
    """The scenario `suturing-by-hand` on DDS, as fast as it goes and without a camera."""
    tree = yaml.safe_load(installed_scenarios()["suturing-by-hand"].read_text())
    tree["participants"]["ros"] |= {"kind": "ros2-dds", "domain": domain, "publish_period": "20 ms"}
    del tree["participants"]["endoscope"]
    tree["order"].remove("endoscope")
    tree["connections"] = [one for one in tree["connections"] if "endoscope" not in one]
    return tree


class Surgeon(RclpyPeer):
    """A program that guides a stitch."""

    def __init__(self, python, domain):
        super().__init__(python, domain)
        params = {"domain": domain, "arms": {"PSM1": {}}, "stitching": True}
        rows = DdsGateway("ros", DdsGateway.params_model.model_validate(params)).rows
        self.rows = {row.topic: row for row in rows if row.owner == "stitch"}
        self.join(list(self.rows.values()), timeout_s=60.0)

    def pick(self, x, y, frame="phantom"):
        point = PointStamped(header=Header(frame_id=frame), point=Point(x=x, y=y))
        self.send(self.rows["/stitch/pick"], point)

    def say(self, word):
        self.send(self.rows["/stitch/command"], StringMessage(data=word))

    def hears(self, topic, text):
        """Wait until a text is heard, and return all of it."""
        heard = ""
        while text not in heard:
            heard = self.heard(self.rows[topic], 60.0).data
        return heard

    def sees(self):
        """Wait until the path is shown, and return the names of what is shown with it."""
        while True:
            shown = {marker.ns for marker in self.heard(self.rows["/stitch/markers"], 60.0).markers}
            if "stitch/path" in shown:
                return shown


def in_turn(surgeon):
    surgeon.hears("/stitch/state", "PICKING")
    surgeon.pick(0.081, 0.0, "nowhere")
    surgeon.hears("/stitch/status", "frame_id 'nowhere' is no frame of this scene")
    surgeon.pick(0.008, 0.018)
    surgeon.pick(-0.008, 0.018)
    surgeon.hears("/stitch/state", "PROPOSED")
    assert {"stitch/entry", "stitch/exit", "stitch/disc", "stitch/banner"} <= surgeon.sees()
    surgeon.say("consent")
    for word, stage in (("pause", "PAUSED"), ("resume", "RUNNING"), ("take over", "TAKEN_OVER")):
        surgeon.say(word)
        surgeon.hears("/stitch/state", stage)
    surgeon.say("resume")
    surgeon.hears("/stitch/state", "RUNNING")


def test_a_program_guides_a_stitch(rclpy_python, tmp_path):
    domain = free_domain()
    (tmp_path / "stitch.yaml").write_text(yaml.safe_dump(scenario(domain)))
    session = launch(load(str(tmp_path / "stitch.yaml")), endpoint="tcp/127.0.0.1:0")

    def program():
        try:
            with Surgeon(rclpy_python, domain) as surgeon:
                in_turn(surgeon)
        finally:
            session.state.shutdown()

    with ThreadPoolExecutor(1) as pool:
        ran = pool.submit(program)
        session.run()
    ran.result()
