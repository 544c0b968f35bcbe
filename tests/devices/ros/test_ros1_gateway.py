"""The gateway to ROS 1, with a real master, as real rospy sees it."""

from contextlib import contextmanager

import pytest

from devices.ros.ros1_gateway import Ros1Gateway
from tests.devices.ros.crtk_table import WHOLE, check_late_joiner, exercise
from tests.devices.ros.rospy_peer import Program, TablePeer, master, needs_rospy, until

pytestmark = needs_rospy

ARM = {"arms": {"PSM1": {}}, "cameras": []}
STATE, COMMAND, EVENT = "/PSM1/measured_js", "/PSM1/servo_jp", "/PSM1/operating_state"
JOINTS, STATE_TYPE, WORD = "sensor_msgs/msg/JointState", "crtk_msgs/msg/OperatingState", "std_msgs/msg/String"


@contextmanager
def showing(ros, directory, name="ros", **params):
    with Ros1Gateway(name, Ros1Gateway.params_model.model_validate({"master": ros.uri, **params})) as gateway:
        gateway.open(directory)
        yield gateway


@pytest.fixture(scope="module")
def ros(tmp_path_factory):
    with master(tmp_path_factory.mktemp("ros")) as it:
        yield it


def test_every_row_of_the_table(ros, tmp_path):
    with showing(ros, tmp_path, **WHOLE) as gateway:
        with Program(ros) as console:
            table = TablePeer(console)
            table.join(gateway.rows)
            exercise(gateway, table)
            assert [client.name for client in gateway._transport.clients()] == ["/console"]
        with Program(ros, "late") as late:
            check_late_joiner(gateway, TablePeer(late))
