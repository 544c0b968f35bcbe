"""Bags as ROS tools write them, of every kind that there is."""

from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from schemas.codec import encode, typestore
from schemas.crtk import StringStamped
from schemas.ros import Header

SECOND = 10**9
EPOCH = 1_700_000_000 * SECOND


def write(path, said, storage=StoragePlugin.MCAP, compression=CompressionMode.NONE):
    writer, connections = Writer2(path, version=9, storage_plugin=storage), {}
    writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        for t, topic, message in said:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.ros_type, typestore=typestore())
            writer.write(
                connections[topic],
                EPOCH + round(t * SECOND),
                message if isinstance(message, bytes) else encode(message),
            )
    return path


def write1(path, said):
    """Write as ROS 1 does, whose header has a number."""
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("std_msgs/Header header\nstring string", StringStamped.ros_type))
    with Writer1(path) as writer:
        connections = {}
        for t, topic, message in said:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, message.ros_type, typestore=store)
            raw = typestore().deserialize_cdr(encode(message), message.ros_type)
            if hasattr(raw, "header"):
                raw.header = store.types[Header.ros_type](
                    seq=7, stamp=raw.header.stamp, frame_id=raw.header.frame_id
                )
            writer.write(
                connections[topic], EPOCH + round(t * SECOND), store.serialize_ros1(raw, message.ros_type)
            )
    return path
