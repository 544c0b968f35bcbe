"""A headset that falls asleep in the middle of a session: the camera holds, the diagnosis says what to do,
and it goes on by itself.
"""

import ctypes

import numpy as np
import pytest

from controllers.ecm_teleoperation import EcmTeleoperation, EcmTeleoperationParams
from devices.libovr.device import LibOvr, LibOvrParams
from hub.participant import Params, Stepped, state_hash
from hub.testing import run_in_process
from robots.dvrk import ecm
from schemas.ports import Port
from tests.devices.standins.build import USABLE, WHY_NOT, compile_library
from tests.devices.test_libovr import Standin

pytestmark = pytest.mark.skipif(not USABLE, reason=WHY_NOT)
MS = 1_000_000


class Wearer(Stepped):
    """Turns the head to the left, takes the headset off for a while, and watches the camera."""

    def __init__(self, head):
        super().__init__("wearer", Params())
        self.head, self.velocities, self.told = head, [], []

    @property
    def ports(self):
        velocity = {"names": ecm.JOINT_NAMES, "fields": ("velocity",)}
        return (
            Port(name="velocity", causality="input", type="sensor_msgs/msg/JointState", **velocity),
            Port(
                name="diagnostics",
                causality="input",
                type="diagnostic_msgs/msg/DiagnosticStatus",
                variability="event",
            ),
        )

    def configure(self, setup):
        self.head.angular[:] = (0.0, 0.2, 0.0)
        return {}

    def step(self, t, h, inputs):
        self.head.time = t * 1e-9 + 1.0
        self.head.status.mounted = not 400 * MS <= t < 800 * MS
        self.velocities.append(inputs["velocity"].copy())
        self.told += [status.message for status in inputs.events("diagnostics")]
        return {}

    def state_hash(self):
        return state_hash()

    def close(self):
        pass


def test_a_headset_asleep_holds_the_camera_and_comes_back(tmp_path):
    library = compile_library("ovr.c", tmp_path / "libOVRRT64.so.1")
    wearer = Wearer(Standin.in_dll(ctypes.CDLL(str(library)), "standin"))
    head, camera = (
        LibOvr("head", LibOvrParams(library=library)),
        EcmTeleoperation("camera", EcmTeleoperationParams()),
    )
    connections = [
        "head.pose -> camera.pose",
        "head.twist -> camera.twist",
        "camera.joint_velocity -> wearer.velocity",
    ]
    scenario = {
        "name": "asleep",
        "step": "4 ms",
        "duration": "1.6 s",
        "pace": "realtime",
        "connections": [*connections, "head.diagnostics -> wearer.diagnostics"],
    }
    run_in_process(scenario, {"head": head, "camera": camera, "wearer": wearer})
    speed = np.linalg.norm(wearer.velocities, axis=1)
    asleep = speed[round(550 / 4) : round(790 / 4)]  # the newest sample may drive for its 100 ms
    assert (asleep == 0.0).all()
    assert np.median(speed[round(300 / 4) : round(390 / 4)]) == pytest.approx(0.2, rel=0.05)
    assert np.median(speed[round(1200 / 4) :]) == pytest.approx(0.2, rel=0.05)
    assert [message.split(";")[0] for message in wearer.told if "tracked" in message or "worn" in message][
        -2:
    ] == [
        "the headset is not worn and asleep",
        "the head is tracked",
    ]
