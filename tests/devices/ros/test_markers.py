"""Markers of a real program on rclpy in the pictures that it gets back, and the example that shows them."""

import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import yaml

from devices.ros.dds.gateway import DdsGateway
from engines.mujoco.markers.frames import SceneFrames
from engines.mujoco.model import build, place
from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.recorded_scene import RecordedScene
from hub.planning.scenario_file import installed_scenarios, load
from hub.recording.recording import Recording
from hub.session.launch import launch
from schemas.codec import decode
from schemas.ros import BoolMessage, Header, Point, Pose, StringMessage, Vector3
from schemas.trocar_msgs import ShownMarkers
from schemas.visualization import ColorRGBA, Marker, MarkerArray, MarkerType
from tests.devices.ros.rclpy_environment import rclpy_python
from tests.devices.ros.rclpy_peer import RclpyPeer, environment, free_domain

__all__ = ["rclpy_python"]

pytest.importorskip("cyclonedds")
mujoco = pytest.importorskip("mujoco")
EXAMPLE = Path(__file__).parents[3] / "examples" / "augmented_reality.py"
AHEAD = 0.05
"""Distance of the markers from the eyes, m: a point of 1 mm is 4 pixels there."""


def scenario(domain):
    """The scenario `ros-vrep` on DDS, with small pictures and no meshes."""
    tree = yaml.safe_load(installed_scenarios()["ros-vrep"].read_text())
    tree["scene"]["looks"] = False
    ros = tree["participants"]["ros"]
    tree["participants"]["ros"] = {**ros, "kind": "ros2-dds", "domain": domain, "publish_period": "20 ms"}
    tree["participants"]["endoscope"] |= {"width": 160, "height": 120, "field_of_view": "45 deg"}
    return tree | {"duration": "300 s"}


def ahead(tree, x, y):
    """A point before the eyes as the suture planner says it: in the remote centre of PSM1."""
    scene = EndoscopeParams.model_validate(tree["scene"])
    model = build(scene)
    data = mujoco.MjData(model)
    place(model, data, scene.arms)
    mujoco.mj_kinematics(model, data)
    frames = SceneFrames(scene, model)
    point = frames.pose("endoscope_left_optical", data) @ [x, y, AHEAD, 1.0]
    x, y, z = (np.linalg.inv(frames.pose("PSM1_base", data)) @ point)[:3].tolist()
    return Point(x=x, y=y, z=z)


class Console(RclpyPeer):
    """A program that publishes markers and looks at the left eye's pictures."""

    def __init__(self, python, domain):
        super().__init__(python, domain)
        params = {"profile": "vrep", "domain": domain, "arms": {"PSM1": {}, "ECM": {}}}
        rows = DdsGateway("ros", DdsGateway.params_model.model_validate(params)).rows
        self.rows = {row.topic: row for row in rows if row.owner in ("stereo", "suture_planner")}
        self.join(list(self.rows.values()), timeout_s=60.0)

    def say(self, topic, message):
        self.send(self.rows[topic], message)

    def sees(self, color, there=True):
        """Wait for a picture in which something of a colour is, or is not any more."""
        for _ in range(200):
            image = self.heard(self.rows["/stereo/left/image_raw"], 60.0)
            picture = image.data.reshape(image.height, image.width, 3).astype(float)
            others = np.delete(picture, color, axis=2).max(axis=2)
            if ((picture[:, :, color] > 60.0) & (picture[:, :, color] > 3.0 * others)).any() == there:
                return True
        return False


def in_turn(console, tree):
    blue, red = (Pose(position=ahead(tree, x, 0.005)) for x in (-0.005, 0.005))
    for color, side, pose in ((2, "sx", blue), (0, "dx", red)):
        assert console.sees(color, there=False)
        console.say(f"/suture_planner/suture_position_{side}", pose)
        assert console.sees(color)
    console.say("/suture_planner/delete_stitches", BoolMessage(data=True))
    assert console.sees(0, there=False)
    assert console.sees(2, there=False)
    sphere = Marker(
        header=Header(frame_id="PSM1_base"),
        ns="mine",
        type=MarkerType.SPHERE,
        pose=Pose(position=ahead(tree, 0.0, 0.0)),
        scale=Vector3(x=2e-3, y=2e-3, z=2e-3),
        color=ColorRGBA(b=1.0, a=1.0),
    )
    lost = sphere.model_copy(update={"header": Header(frame_id="PSM7"), "id": 1})
    console.say("/stereo/markers", MarkerArray(markers=[lost, sphere]))
    assert console.sees(2)
    told = console.heard(console.rows["/stereo/error"], 60.0)
    assert isinstance(told, StringMessage)
    assert "1 rejected: marker 'mine' 1: frame_id 'PSM7' is no frame of this scene" in told.data
    red = sphere.model_copy(update={"color": ColorRGBA(r=1.0, a=1.0)})
    console.say("/stereo/markers", MarkerArray(markers=[red]))
    assert console.sees(2, there=False)
    assert console.sees(0)


def test_a_program_changes_the_pictures_that_it_gets(rclpy_python, tmp_path):
    if not opengl.find().name:
        pytest.skip("no OpenGL")
    domain = free_domain()
    tree = scenario(domain)
    (tmp_path / "vrep.yaml").write_text(yaml.safe_dump(tree))
    session = launch(load(str(tmp_path / "vrep.yaml")), endpoint="tcp/127.0.0.1:0", record=tmp_path / "seen")

    def programs():
        try:
            with Console(rclpy_python, domain) as console:
                in_turn(console, tree)
            example = subprocess.run(
                [rclpy_python, EXAMPLE, "--camera", "/stereo", "--seconds", "0.1"],
                env=environment(domain),
                capture_output=True,
                text=True,
                timeout=60,
                check=False,
            )
            assert example.returncode == 0, example.stderr
            return example.stdout
        finally:
            session.state.shutdown()

    with ThreadPoolExecutor(1) as pool:
        ran = pool.submit(programs)
        session.run()
    shown = ran.result().splitlines()
    assert "shown: Pick the entry" in shown[:2]  # its error comes on another topic, before or after
    assert "shown: Done" in shown[-2:]
    check_recording(Recording(tmp_path / "seen"))


def check_recording(recording):
    """What was shown is in the recording, and `trocar render` draws it."""
    sent = [
        (message.time_ns, decode(ShownMarkers, message.payload))
        for message in recording.messages("/engine/markers/out/shown")
    ]
    first = next(at for at, shown in sent if "suture_planner/sx" in shown.namespaces)
    scene = RecordedScene(recording)
    before, after = (scene.picture(at, "left", (160, 120)) for at in (first - 20_000_000, first))
    assert (before != after).any()
    assert {"words", "entry", "exit"} <= {name for _, shown in sent for name in shown.namespaces}
