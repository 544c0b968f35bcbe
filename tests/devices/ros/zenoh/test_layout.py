"""The layout of rmw_zenoh, held against what nodes of ROS 2 Jazzy (rmw_zenoh 0.2.11) have on the wire, and
against hashes that ROS ships.
"""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.ros.params import GatewayParams
from devices.ros.topics.dvrk_table import dvrk_table
from devices.ros.zenoh.graph import gid_of
from devices.ros.zenoh.layout import LATCHED, VOLATILE, Attachment, GraphToken, graph_key, key, type_hash
from devices.ros.zenoh.service_hash import service_hash
from schemas.errors import MessageError
from tests.devices.ros.zenoh.zenoh_peer import TYPES

STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
NODE = "@ros2_lv/0/914ec2c920f5151f26394cf0ba959999/0/0/NN/%/%/p_tl"
PUBLISHER = (
    "@ros2_lv/0/914ec2c920f5151f26394cf0ba959999/0/4/MP/%/%/p_tl/%q_transient"
    f"/std_msgs::msg::dds_::String_/{STRING_HASH}/:1:,10:,:,:,,"
)
SENT = bytes.fromhex("15000000000000008903674cf9a2dc1810b9249d3fec6b1be4c0c8a0e3eb3550bb")
NAMESPACED = (
    "@ros2_lv/7/6977b59f87229328a8d406ad77b301a6/0/11/MP/%/%cell4/gw/%cell4%chatter"
    f"/std_msgs::msg::dds_::String_/{STRING_HASH}/::,7:,:,:,,"
)
"""As captured from `ros2 topic pub` of Jazzy: a node, its latched publisher, the attachment of a message of
that, and a publisher in a namespace.
"""


def test_tokens_are_those_of_a_real_node():
    node = GraphToken.parse_token(NODE)
    assert node == GraphToken("914ec2c920f5151f26394cf0ba959999", 0, "NN", "/p_tl")
    assert node.key(0) == NODE
    publisher = GraphToken.parse_token(PUBLISHER)
    assert (publisher.number, publisher.kind, publisher.node, publisher.topic) == (
        4,
        "MP",
        "/p_tl",
        "/q_transient",
    )
    assert (
        GraphToken(
            publisher.session,
            4,
            "MP",
            "/p_tl",
            "/q_transient",
            "std_msgs/msg/String",
            STRING_HASH,
            ":1:,10:,:,:,,",
        ).key(0)
        == PUBLISHER
    )
    assert GraphToken.parse_token(NAMESPACED).node == "/cell4/gw"
    assert GraphToken.parse_token(NAMESPACED).topic == "/cell4/chatter"


def test_ids_and_attachments_are_those_of_a_real_node():
    attached = Attachment.unpack(SENT)
    assert (attached.sequence, attached.gid) == (21, gid_of(PUBLISHER))
    assert attached.pack() == SENT


@pytest.mark.parametrize(
    "token",
    [
        "",
        "@ros2_lv/0",
        PUBLISHER.replace("MP", "XX"),
        PUBLISHER + "/more",
        NODE.replace("/0/0/", "/0/x/"),
        "trocar/s/alive/hub/hub",
    ],
)
def test_other_tokens_are_left_alone(token):
    assert GraphToken.parse_token(token) is None


@given(st.binary(max_size=64))
def test_bytes_that_are_no_attachment_are_refused(data):
    if len(data) == 33 and data[16] == 16:
        assert Attachment.unpack(data).pack() == data
    else:
        with pytest.raises(MessageError, match="are no attachment of ROS 2"):
            Attachment.unpack(data)


def test_keys_hold_domain_topic_type_and_hash():
    assert (
        key(0, "/chatter", "std_msgs/msg/String") == f"0/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"
    )
    assert key(42, "/PSM1/measured_js", "sensor_msgs/msg/JointState").startswith(
        "42/PSM1/measured_js/sensor_msgs::msg::dds_::JointState_/RIHS01_"
    )
    assert graph_key(42) == "@ros2_lv/42/**"


def test_a_service_has_the_hash_that_ros_ships():
    # ros-jazzy-std-srvs, share/std_srvs/srv/Trigger.json
    shipped = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
    assert service_hash("std_srvs/srv/Trigger", "", "bool success\nstring message") == shipped


def test_every_type_of_the_table_has_a_hash():
    everything = GatewayParams.model_validate(
        {"arms": {"PSM1": {}, "ECM": {}}, "listen": ["MTMR"], "teleoperations": ["MTMR_PSM1"]}
    )
    for type_ in {row.type for row in dvrk_table(everything)}:
        assert type_hash(type_).startswith("RIHS01_")
        if type_ in TYPES.types:  # of the peer, which has the types from rosbags and their texts from CRTK
            assert type_hash(type_) == TYPES.hash_rihs01(type_), type_


def test_the_two_qualities_differ_in_durability_and_depth():
    assert (LATCHED, VOLATILE) == (":1:,1:,:,:,,", "::,10:,:,:,,")
