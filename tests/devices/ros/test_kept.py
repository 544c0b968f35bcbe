"""Messages that a program has kept from before it was connected: commands are not heeded, states of real arms
are.
"""

import time

import numpy as np
import pytest

from devices.ros.params import GatewayParams
from schemas.codec import encode
from schemas.crtk import OperatingState, StringStamped
from schemas.ros import EmptyMessage, Header, JointState, StringMessage, Time
from tests.devices.ros.memory import MemoryGateway

SECOND = 10**9
JOINTS = np.full(6, 0.1)


def stamped(stamp_ns):
    return Header(stamp=Time.from_ns(stamp_ns))


@pytest.fixture
def gateway(tmp_path):
    params = GatewayParams.model_validate({"arms": {"PSM1": {}}, "cameras": [], "listen": ["MTML"]})
    with MemoryGateway("ros", params) as it:
        it.open(tmp_path)
        yield it


def came_in(gateway, topic, message, linked_ns):
    gateway.transport.takers[topic](encode(message), "/console", linked_ns=linked_ns)
    return any(sample.port == topic[1:] for sample in gateway.read(0))


@pytest.mark.parametrize(
    ("topic", "message"),
    [
        ("/PSM1/state_command", StringStamped(string="home")),
        ("/PSM1/move_jp", JointState(position=JOINTS)),
        ("/PSM1/free", EmptyMessage()),
        ("/PSM1/set_tool_type", StringMessage(data="LARGE_NEEDLE_DRIVER_400006")),
    ],
)
def test_a_command_without_a_stamp_is_told_and_not_heeded(gateway, topic, message):
    assert not came_in(gateway, topic, message, time.time_ns())
    (warning,) = gateway.transport.heard("/PSM1/warning")
    assert "kept by /console from before it was connected" in warning.data
    assert came_in(gateway, topic, message, 0), "the same, when it is given"


def test_the_stamp_says_whether_it_is_from_before(gateway):
    now = time.time_ns()
    assert not came_in(
        gateway, "/PSM1/move_jp", JointState(header=stamped(now - SECOND), position=JOINTS), now
    )
    assert came_in(gateway, "/PSM1/move_jp", JointState(header=stamped(now + 1), position=JOINTS), now)


def test_what_a_real_arm_has_kept_is_its_state(gateway):
    assert came_in(
        gateway,
        "/MTML/operating_state",
        OperatingState(header=stamped(SECOND), state="ENABLED"),
        time.time_ns(),
    )
