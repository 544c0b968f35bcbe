"""Latched messages from before a connection: commands are refused, states of real arms accepted."""

import time

import numpy as np
import pytest

from devices.ros.params import GatewayParams
from devices.ros.topics import subscriptions
from schemas.codec import encode
from schemas.crtk import OperatingState, StringStamped
from schemas.ros import EmptyMessage, Header, JointState, StringMessage, Time
from tests.devices.ros.helpers import received
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


def accepts(gateway, topic, message, connected_ns):
    gateway.transport.receivers[topic](encode(message), "/console", connected_ns=connected_ns)
    return bool(received(gateway, topic))


@pytest.mark.parametrize(
    ("topic", "message"),
    [
        ("/PSM1/state_command", StringStamped(string="home")),
        ("/PSM1/move_jp", JointState(position=JOINTS)),
        ("/PSM1/free", EmptyMessage()),
        ("/PSM1/set_tool_type", StringMessage(data="LARGE_NEEDLE_DRIVER_400006")),
    ],
)
def test_a_command_without_a_stamp_is_refused_with_a_warning(gateway, topic, message):
    assert not accepts(gateway, topic, message, time.time_ns())
    (warning,) = gateway.transport.heard("/PSM1/warning")
    assert "published by /console before it was connected" in warning.data
    assert accepts(gateway, topic, message, 0), "the same, published after it was connected"


def test_the_stamp_says_whether_it_is_from_before(gateway):
    now = time.time_ns()
    assert not accepts(
        gateway, "/PSM1/move_jp", JointState(header=stamped(now - SECOND), position=JOINTS), now
    )
    assert accepts(gateway, "/PSM1/move_jp", JointState(header=stamped(now + 1), position=JOINTS), now)


def test_what_a_real_arm_has_kept_is_its_state(gateway):
    assert accepts(
        gateway,
        "/MTML/operating_state",
        OperatingState(header=stamped(SECOND), state="ENABLED"),
        time.time_ns(),
    )


def test_a_wall_clock_that_is_set_back_does_not_make_a_new_command_an_old_one(gateway, monkeypatch):
    def corrected_ns():
        return time.time_ns() - 3600 * SECOND

    monkeypatch.setattr(subscriptions, "time_ns", corrected_ns)
    old = StringStamped(header=stamped(corrected_ns() - 60 * SECOND), string="home")
    assert not accepts(gateway, "/PSM1/state_command", old, 0)
    new = StringStamped(header=stamped(corrected_ns()), string="disable")
    assert accepts(gateway, "/PSM1/state_command", new, 0)
