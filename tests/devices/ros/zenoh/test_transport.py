"""ROS 2 over Zenoh: the end of a transport, while other threads publish and programs come and go."""

import threading
from functools import partial

import pytest

from devices.ros.topics.row import Row
from devices.ros.zenoh.transport import ZenohTransport
from hub.transport.zenoh_session import open_session
from tests.devices.ros.zenoh.test_gateway import router
from tests.devices.ros.zenoh.zenoh_peer import Peer
from tests.waiting import until

STRING = "std_msgs/msg/String"
HELLO = b"\0\1\0\0\6\0\0\0hello\0"


@pytest.fixture
def endpoint():
    with router() as it:
        yield it


@pytest.mark.parametrize("latched", [False, True])
def test_it_closes_while_another_thread_publishes(endpoint, latched):
    for _ in range(10):
        transport = ZenohTransport(partial(open_session, "client", connect=[endpoint]), 0)
        publish = [
            transport.advertise(Row(f"/arm/text{i}", STRING, "publish", latched=latched)) for i in range(8)
        ]
        ending, published = threading.Event(), threading.Event()

        def keep_on(publish=publish, ending=ending, published=published):
            while not ending.is_set():
                for one in publish:
                    one(HELLO)
                published.set()

        thread = threading.Thread(target=keep_on)
        thread.start()
        try:
            assert published.wait(60.0)
            transport.close()
        finally:
            ending.set()
            thread.join()


def test_an_error_at_one_part_leaves_no_session_open(endpoint, monkeypatch):
    sessions = []

    def connect():
        sessions.append(open_session("client", connect=[endpoint]))
        return sessions[-1]

    transport = ZenohTransport(connect, 0)
    broken = transport.advertise(Row("/arm/text", STRING, "publish"))
    transport.advertise(Row("/endoscope/left/image_raw", "sensor_msgs/msg/Image", "publish"))

    def refuse():
        raise RuntimeError("Already borrowed")

    monkeypatch.setattr(type(broken), "undeclare", lambda one: refuse() if one is broken else None)
    with pytest.raises(RuntimeError, match="Already borrowed"):
        transport.close()
    assert [session.is_closed() for session in sessions] == [True, True]


def test_a_publisher_knows_whether_a_program_subscribes(endpoint):
    transport = ZenohTransport(partial(open_session, "client", connect=[endpoint]), 0)
    changes = []
    transport.changed = lambda: changes.append(publish.wanted)
    try:
        publish = transport.advertise(Row("/arm/text", STRING, "publish"))
        assert not publish.wanted
        with Peer(endpoint) as peer:
            peer.listen("/arm/text", STRING, lambda *_: None)
            assert until(lambda: publish.wanted)
        assert until(lambda: not publish.wanted)
        assert True in changes, "a gateway is told"
        assert changes[-1] is False
    finally:
        transport.close()
    assert not publish.wanted
    publish(HELLO)
