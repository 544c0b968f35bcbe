"""The topics of the authors' suture planner and filter, with a program over each gateway."""

import pytest
import yaml

from hub.planning.scenario_file import installed_scenarios
from hub.recording.recording import Recording
from schemas.codec import decode
from schemas.ros import BoolMessage, Header, Point, Pose, StringMessage, Vector3
from schemas.trocar_msgs import ShownMarkers
from schemas.visualization import ColorRGBA, Marker, MarkerArray, MarkerType
from tests.devices.ros.any_gateway import middleware, rclpy_python

__all__ = ["middleware", "rclpy_python"]

pytest.importorskip("cv2")
pytest.importorskip("mujoco")

TRACKER = {"kind": "needle-tracker", "period": "40 ms", "grasp": {"position": [0, 0, "20 mm"]}}
TRACKER["grasp"]["orientation"] = [0.0, 0.0, 0.0, 1.0]


def scenario():
    """The scenario `ros-vrep` without a camera, and with a tracker that is blind."""
    tree = yaml.safe_load(installed_scenarios()["ros-vrep"].read_text())
    del tree["participants"]["endoscope"]
    tree["participants"]["tracker"] = TRACKER
    tree["order"][-1] = "tracker"
    tree["connections"] = [one for one in tree["connections"] if "endoscope" not in one]
    tree["connections"] += [
        "robot.PSM1/measured_js -> tracker.PSM1/measured_js",
        "robot.ECM/measured_js -> tracker.ECM/measured_js",
        "tracker.* -> ros.*",
    ]
    return tree


def program(peer, rows):
    """Show all that the planner shows, hear the filter, and send a marker that is rejected."""
    wanted = {topic: row for topic, row in rows.items() if not topic.endswith(("image_raw", "camera_info"))}
    peer.join(list(wanted.values()))

    def planner(topic, message):
        peer.send(rows[f"/suture_planner/{topic}"], message)

    def errors(frame):
        """Send a marker in a frame that is none, and wait until that is said."""
        marker = Marker(
            header=Header(frame_id=frame),
            ns="mine",
            type=MarkerType.SPHERE,
            pose=Pose(position=Point(z=0.1)),
            scale=Vector3(x=2e-3, y=2e-3, z=2e-3),
            color=ColorRGBA(g=1.0, a=1.0),
        )
        peer.send(rows["/stereo/markers"], MarkerArray(markers=[marker]))
        while frame not in (text := peer.heard(rows["/stereo/error"], 60.0).data):
            pass
        return text

    for x in (-0.01, 0.0, 0.01):
        planner("suture_position_sx", Pose(position=Point(x=x, z=-0.1)))
        planner("suture_position_dx", Pose(position=Point(x=x, y=0.02, z=-0.1)))
    planner("user_position", Pose(position=Point(z=-0.1)))
    planner("user_position_2", Pose(position=Point(z=-0.1)))
    planner("state_current", StringMessage(data="Insertion"))
    said = errors("PSM7")
    planner("delete_stitches", BoolMessage(data=True))
    errors("PSM8")
    return said, peer.heard(rows["/kalmanOutput"], 60.0), peer.heard(rows["/Tcn_hat"], 60.0)


@pytest.mark.long
def test_a_program_shows_stitches_and_hears_the_filter(middleware):
    said, pose, matrix = middleware.run(scenario(), {"stereo", "suture_planner", ""}, program)
    assert "1 rejected: marker 'mine' 0: frame_id 'PSM7' is no frame of this scene" in said
    assert pose.header.frame_id == "PSM1_base"
    assert len(matrix.data) == 12
    recording = Recording(middleware.directory / "seen")
    shown = [
        decode(ShownMarkers, message.payload) for message in recording.messages("/engine/markers/out/shown")
    ]
    fullest = max(shown, key=lambda each: len(each.namespaces))
    points = {"suture_planner/sx": (0.0, 0.0, 1.0), "suture_planner/dx": (1.0, 0.0, 0.0)}
    for name, color in points.items():
        numbers = [i for i, each in enumerate(fullest.namespaces) if each == name]
        assert len(numbers) == 3
        assert all(tuple(fullest.colors[4 * i : 4 * i + 3]) == color for i in numbers)
    assert any("Insertion" in each.texts for each in shown)
    assert not points.keys() & set(shown[-1].namespaces)
