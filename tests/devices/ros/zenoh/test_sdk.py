"""The table through zenoh-ros2-sdk, a client of others: Robotis' own way to speak ROS 2 on Zenoh without ROS.

It fetches definitions of messages from GitHub; here it finds them in a directory, written from rosbags' and
from CRTK's own texts.
"""

import logging
import queue
from contextlib import ExitStack, contextmanager

import pytest

from schemas.codec import message_type
from tests.devices.ros.crtk_table import WHOLE, exercise
from tests.devices.ros.zenoh.test_gateway import EVENT, STATE, router, showing
from tests.devices.ros.zenoh.zenoh_peer import CRTK, TYPES, built, flat
from tests.waiting import until

sdk = pytest.importorskip("zenoh_ros2_sdk", reason="needs zenoh-ros2-sdk: pip install 'trocar[test]'")


def write_definitions(directory):
    """Write the .msg files of ROS 2 Jazzy that rosbags knows, and those of CRTK with its services."""
    for name in TYPES.types:
        if name.count("/") == 2 and name not in CRTK:
            package, _, short = name.split("/")
            text, _ = TYPES.generate_msgdef(name, ros_version=2)
            _write(directory / package / "msg" / f"{short}.msg", text.split("=" * 80)[0])
    for name, text in CRTK.items():
        package, _, short = name.split("/")
        if not short.startswith("Query"):
            _write(directory / package / "msg" / f"{short}.msg", text)
        elif short.endswith("_Request"):
            service = short.removesuffix("_Request")
            _write(
                directory / package / "srv" / f"{service}.srv",
                f"{text}\n---\n{CRTK[f'{package}/msg/{service}_Response']}",
            )


def _write(file, text):
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)


@contextmanager
def connected(endpoint, directory):
    """A session of the SDK, which has one per process."""
    write_definitions(directory)
    sdk.get_registry().messages_dir = directory
    host, port = endpoint.removeprefix("tcp/").split(":")
    session = sdk.ZenohSession.get_instance(host, int(port))
    try:
        yield {"router_ip": host, "router_port": int(port), "domain_id": 0}
    finally:
        session.close()


class SdkPeer:
    def __init__(self, where, stack):
        self.where, self.stack, self.publishers, self.heard_of, self.clients = where, stack, {}, {}, {}

    def _kept(self, thing):
        self.stack.callback(thing.close)
        return thing

    def join(self, rows):
        for row in rows:
            if row.way == "publish":
                heard = self.heard_of[row.topic] = queue.Queue()
                quality = sdk.subscriber.QosProfile.decode(":1:,1:,:,:,," if row.latched else "::,10:,:,:,,")
                self._kept(sdk.ROS2Subscriber(row.topic, row.type, heard.put, qos=quality, **self.where))
            elif row.way == "subscribe":
                self.publishers[row.topic] = self._kept(sdk.ROS2Publisher(row.topic, row.type, **self.where))
            else:
                self.clients[row.topic] = self._kept(sdk.ROS2ServiceClient(row.topic, row.type, **self.where))

    def send(self, row, message):
        publisher = self.publishers[row.topic]
        publisher.publish(**vars_of(built(publisher.session_mgr.store, row.type, message.model_dump())))

    def heard(self, row, timeout_s):
        try:
            return message_type(row.type).model_validate(
                flat(self.heard_of[row.topic].get(timeout=timeout_s))
            )
        except queue.Empty:
            raise TimeoutError(row.topic) from None

    def call(self, row, request):
        client = self.clients[row.topic]
        fields = vars_of(built(client.session_mgr.store, client.request_store_type, request.model_dump()))
        return message_type(f"{row.type}_Response").model_validate(flat(client.call(**fields)))


def vars_of(message):
    return {name: value for name, value in vars(message).items() if not name.startswith("__")}


def published(gateway):
    """Return the Zenoh publishers of the gateway."""
    return [one for one in gateway._transport._entities if hasattr(one, "matching_status")]


@pytest.mark.long
def test_the_table_through_a_client_of_others(tmp_path, caplog):
    caplog.set_level(logging.ERROR, "zenoh_ros2_sdk")
    with router() as hub, showing(hub, tmp_path, **WHOLE) as gateway, ExitStack() as stack:
        where = stack.enter_context(connected(hub, tmp_path / "messages"))
        peer = SdkPeer(where, stack)
        peer.join(gateway.rows)
        until(lambda: all(one.matching_status.matching for one in published(gateway)))
        exercise(gateway, peer)
        (client,) = gateway._transport.clients()
        assert client.address == str(sdk.ZenohSession.get_instance().session.zid())


def test_its_tools_list_what_the_gateway_shows(tmp_path):
    with (
        router() as hub,
        showing(hub, tmp_path, arms={"PSM1": {}}) as gateway,
        connected(hub, tmp_path / "messages"),
    ):
        listed = dict(sdk.get_topic_names_and_types(domain_id=0))
        assert {row.topic for row in gateway.rows if row.way != "serve"} == listed.keys()
        assert listed[STATE] == ["sensor_msgs/msg/JointState"]
        assert listed[EVENT] == ["crtk_msgs/msg/OperatingState"]
        assert dict(sdk.get_service_names_and_types(domain_id=0))["/PSM1/inverse_kinematics"] == [
            "crtk_msgs/srv/QueryInverseKinematics"
        ]
