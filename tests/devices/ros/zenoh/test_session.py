"""The gateway as a participant: in the hub's process and in a host of its own, found by a program at the
hub's address.
"""

import threading
import time

import pytest

from tests.devices.ros.zenoh.test_gateway import COMMAND, JOINTS, STATE, joints
from tests.devices.ros.zenoh.zenoh_peer import Peer
from tests.hub.conftest import install_plugin, prepare, toys
from tests.waiting import until

__all__ = ["install_plugin", "prepare", "toys"]

TEXT = """
name: consoles
step: 5 ms
pace: realtime
participants:
  motion: {kind: "echo:Echo"}
  ros: {kind: ros2-zenoh, host: HOST, arms: {PSM1: {}}, cameras: []}
connections:
  - motion.PSM1/measured_js -> ros.PSM1/measured_js
  - ros.PSM1/servo_jp -> motion.PSM1/servo_jp
"""

ECHO = '''
"""An arm without inertia or limits: it is where it was last told to be."""

import numpy as np

from devices.ros.topics.dvrk_table import dvrk_table
from devices.ros.params import GatewayParams
from hub.participant import Stepped, state_hash

ROWS = {row.topic: row.port for row in dvrk_table(GatewayParams.model_validate({"arms": {"PSM1": {}}}))}


class Echo(Stepped):
    @property
    def ports(self):
        return (
            ROWS["/PSM1/measured_js"].model_copy(update={"causality": "output"}),
            ROWS["/PSM1/servo_jp"].model_copy(update={"causality": "input", "clock": "simulated"}),
        )

    def configure(self, setup):
        self.state = np.zeros(18)
        return {"PSM1/measured_js": self.state}

    def step(self, t, h, inputs):
        for message in inputs.events("PSM1/servo_jp"):
            self.state[:6] = message.position
        return {"PSM1/measured_js": self.state}

    def state_hash(self):
        return state_hash(self.state)

    def close(self):
        pass
'''


@pytest.mark.parametrize("host", ["hub", "gateways"])
def test_a_program_moves_an_arm(host, prepare, tmp_path, monkeypatch):
    (tmp_path / "echo.py").write_text(ECHO)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=":")
    session, failures, heard = prepare(TEXT.replace("HOST", host)), [], []

    def console():
        try:
            with Peer(session.programs_endpoint) as program:
                program.listen(STATE, JOINTS, lambda message, _: heard.append(message.position.tolist()))
                assert until(lambda: heard), "no state came"
                publish = program.publisher(COMMAND, JOINTS)
                assert until(
                    lambda: publish(joints([0.1] * 6)) or time.sleep(0.05) or heard[-1] == [0.1] * 6, 10.0
                ), "the arm did not move"
        except Exception as error:  # noqa: BLE001  # it is raised in the main thread
            failures.append(error)
        finally:
            session.state.shutdown()

    threading.Timer(1.0, console).start()
    session.run()
    assert not failures, failures
