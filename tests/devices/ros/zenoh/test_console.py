"""A ROS 2 program on another machine, at the gate of a hub."""

from functools import partial

import numpy as np
import pytest

from devices.ros.zenoh.gateway import ZenohGateway
from hub.planning.plan import Plan, PlannedParticipant
from hub.security.access import access_settings
from hub.security.gate import Gate
from hub.transport.zenoh_session import open_session
from schemas.crtk import OperatingState
from schemas.keys import Keys
from schemas.ros import StringMessage
from tests.devices.ros.helpers import received
from tests.devices.ros.zenoh.test_gateway import (
    ARM,
    COMMAND,
    EVENT,
    JOINTS,
    STATE,
    STATE_TYPE,
    joints,
    router,
    showing,
)
from tests.devices.ros.zenoh.zenoh_peer import TYPES, Peer, built
from tests.hub.authorities import Authority, free_port
from tests.waiting import until

KEYS = Keys("s")
PLAN = Plan(
    step_ns=1_000_000,
    order=(),
    participants={
        "ros": PlannedParticipant(
            name="ros", kind="ros2-zenoh", role="device", host="hub", period=1, ports=()
        )
    },
    connections=(),
    from_devices=(),
    to_devices=(),
    bonds=(),
)


@pytest.fixture
def gated(tmp_path):
    """A gateway at a hub with a gate; gives the gateway, the gate's endpoint and what makes certificates."""
    authority, outside = Authority.founded(tmp_path), f"tls/127.0.0.1:{free_port()}"
    with router() as inside, showing(inside, tmp_path, **ARM) as gateway:
        gate = Gate(
            [outside], authority.hub.listening() | access_settings(PLAN, "s", {"ros": gateway.foreign_keys})
        )
        gate.open(inside)
        try:
            yield gateway, outside, authority
        finally:
            gate.close()


def settings(credentials):
    """Return Zenoh's settings of a program: one file holds key, certificate and authority."""
    names = ("root_ca_certificate", "connect_private_key", "connect_certificate")
    return {f"transport/link/tls/{name}": str(credentials.file) for name in names} | {
        "transport/link/tls/enable_mtls": True
    }


def test_who_has_the_certificate_of_a_console_may_do_all_that_ros_programs_do(gated):
    gateway, endpoint, authority = gated
    with Peer(endpoint, settings=settings(authority.issued("console"))) as console:
        heard, events = [], []
        console.listen(STATE, JOINTS, lambda message, _: heard.append(message))
        console.listen(
            "/PSM1/status",
            "std_msgs/msg/String",
            lambda message, _: events.append(message.data),
            latched=True,
        )
        publish = console.publisher(COMMAND, JOINTS)
        gateway.write(STATE[1:], np.zeros(18))
        gateway.write("PSM1/status", StringMessage(data="here"))
        assert until(lambda: heard and events)
        publish(joints())
        assert until(lambda: received(gateway, COMMAND))
        assert [client.name for client in gateway._transport.clients()] == ["/console"]
        nowhere = {
            "position": dict.fromkeys("xyz", 0.0),
            "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        }
        request = built(
            TYPES, "crtk_msgs/msg/QueryForwardKinematics_Request", {"jp": [0.0] * 6, "cp": nowhere}
        )
        assert console.call(
            "/PSM1/local/forward_kinematics", "crtk_msgs/srv/QueryForwardKinematics", request
        )[0].result


def test_a_late_console_gets_the_last_event(gated):
    gateway, endpoint, authority = gated
    gateway.write(EVENT[1:], OperatingState(state="ENABLED"))
    with Peer(endpoint, settings=settings(authority.issued("console"))) as console:
        states = []
        console.listen(EVENT, STATE_TYPE, lambda message, _: states.append(message.state), latched=True)
        assert until(lambda: states == ["ENABLED"])


def test_a_gateway_on_another_machine_is_seen_at_the_hub(tmp_path):
    authority, outside = Authority.founded(tmp_path), f"tls/127.0.0.1:{free_port()}"
    with router() as inside:
        gateway = ZenohGateway("ros", ZenohGateway.params_model.model_validate(ARM))
        far = PLAN.model_copy(
            update={
                "participants": {"ros": PLAN.participants["ros"].model_copy(update={"host": "remote/ros"})}
            }
        )
        gate = Gate(
            [outside], authority.hub.listening() | access_settings(far, "s", {"ros": gateway.foreign_keys})
        )
        gate.open(inside)
        gateway.learn_hub(
            partial(open_session, "client", connect=[outside], security=authority.issued("ros").connecting())
        )
        try:
            with gateway, Peer(inside) as console:
                gateway.open(tmp_path)
                heard, states = [], []
                console.listen(STATE, JOINTS, lambda message, _: heard.append(message))
                console.listen(
                    EVENT, STATE_TYPE, lambda message, _: states.append(message.state), latched=True
                )
                gateway.write(EVENT[1:], OperatingState(state="ENABLED"))
                assert until(lambda: gateway.write(STATE[1:], np.zeros(18)) or (heard and states))
                console.publisher(COMMAND, JOINTS)(joints())
                assert until(lambda: received(gateway, COMMAND))
        finally:
            gate.close()


@pytest.mark.parametrize(("name", "domain"), [("console", 1), ("observer", 0)])
def test_nobody_gets_more_than_that(gated, name, domain, caplog):
    _, endpoint, authority = gated
    with Peer(endpoint, settings=settings(authority.issued(name)), domain=domain) as other:
        assert {entry[0] for entry in other.graph()} <= {"console"}, (
            "of another domain, or with another certificate, one sees only oneself"
        )
        assert list(other.session.get(KEYS.control("shutdown"), timeout=1.0)) == []
        other.session.put(KEYS.output("device", "ros", COMMAND[1:]), b"x")
        assert until(
            lambda: f"refused to '{name}'" in caplog.text and "put on trocar/s/device/ros" in caplog.text
        )
