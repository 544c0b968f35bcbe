"""A ROS 2 program on Zenoh that shares nothing with the gateway: written from rmw_zenoh's docs/design.md
alone, on eclipse-zenoh and rosbags.

As a program, `python -m tests.devices.ros.zenoh.zenoh_peer ENDPOINT DOMAIN`, it prints that it is ready, and
subscribes to all topics until it is killed.
"""

import json
import os
import struct
import sys
import time
from dataclasses import fields as fields_of
from dataclasses import is_dataclass

import numpy as np
import zenoh
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from zenoh import ext
from zenoh.handlers import Callback, FifoChannel

CRTK = {
    "crtk_msgs/msg/OperatingState": "std_msgs/Header header\nstring state\nbool is_homed\nbool is_busy",
    "crtk_msgs/msg/StringStamped": "std_msgs/Header header\nstring string",
    "crtk_msgs/msg/CartesianState": (
        "std_msgs/Header header\ngeometry_msgs/Pose pose\nstd_msgs/Bool pose_is_valid\ngeometry_msgs/Twist"
        " twist\nstd_msgs/Bool twist_is_valid\ngeometry_msgs/Wrench wrench\nstd_msgs/Bool wrench_is_valid"
    ),
    "crtk_msgs/msg/CartesianImpedanceHalfPlaneGains": "\n".join(
        f"geometry_msgs/Vector3 {name}" for name in ("p", "d", "bias", "deadband")
    ),
    "crtk_msgs/msg/CartesianImpedance": (
        "std_msgs/Header header\ngeometry_msgs/Quaternion force_orientation\ngeometry_msgs/Vector3"
        " force_position\ngeometry_msgs/Quaternion torque_orientation\nCartesianImpedanceHalfPlaneGains"
        " position_positive\nCartesianImpedanceHalfPlaneGains"
        " position_negative\nCartesianImpedanceHalfPlaneGains"
        " orientation_positive\nCartesianImpedanceHalfPlaneGains orientation_negative"
    ),
    "crtk_msgs/msg/QueryForwardKinematics_Request": "float64[] jp\ngeometry_msgs/Pose cp",
    "crtk_msgs/msg/QueryForwardKinematics_Response": "geometry_msgs/Pose cp\nbool result\nstring message",
    "crtk_msgs/msg/QueryInverseKinematics_Request": "geometry_msgs/Pose cp\nfloat64[] jp",
    "crtk_msgs/msg/QueryInverseKinematics_Response": "float64[] jp\nbool result\nstring message",
}
TYPES = get_typestore(Stores.ROS2_JAZZY)
for _name, _text in CRTK.items():
    TYPES.register(get_types_from_msg(_text, _name))


def opened(endpoint, settings=None, mode="peer"):
    """Return a session with the settings that rmw_zenoh ships: a peer that talks to the router first, and
    gossips.
    """
    config = zenoh.Config()
    ours = {
        "mode": mode,
        "connect/endpoints": [endpoint],
        "listen/endpoints": ["tcp/localhost:0"] if mode == "peer" else [],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": True,
        "timestamping/enabled": True,
        **(settings or {}),
    }
    for key, value in ours.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


def dds(type_):
    package, kind, name = type_.split("/")
    return f"{package}::{kind}::dds_::{name}_"


class Peer:
    """A node."""

    def __init__(self, endpoint, name="console", domain=0, settings=None, mode="peer"):
        self.session, self.name, self.domain, self.count, self.kept = (
            opened(endpoint, settings, mode),
            name,
            domain,
            0,
            [],
        )
        self.id = str(self.session.zid())
        self.kept.append(
            self.session.liveliness().declare_token(f"@ros2_lv/{domain}/{self.id}/0/0/NN/%/%/{name}")
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        for thing in self.kept:
            thing.undeclare()
        self.session.close()

    def _token(self, kind, topic, type_, hash_, latched):
        self.count += 1
        quality = ":1:,1:,:,:,," if latched else "::,10:,:,:,,"
        entity = f"@ros2_lv/{self.domain}/{self.id}/0/{self.count}/{kind}/%/%/{self.name}"
        key = f"{entity}/{topic.replace('/', '%')}/{dds(type_)}/{hash_}/{quality}"
        self.kept.append(self.session.liveliness().declare_token(key))

    def key(self, topic, type_):
        return f"{self.domain}/{topic.strip('/')}/{dds(type_)}/{TYPES.hash_rihs01(type_)}"

    def publisher(self, topic, type_):
        """Return what publishes a message given by its fields."""
        self._token("MP", topic, type_, TYPES.hash_rihs01(type_), latched=False)
        publisher = self.session.declare_publisher(
            self.key(topic, type_), congestion_control=zenoh.CongestionControl.BLOCK
        )
        self.kept.append(publisher)
        gid, sent = os.urandom(16), 0
        end = time.monotonic() + 60.0
        # as a program waits for its subscribers
        while not publisher.matching_status.matching and time.monotonic() < end:
            time.sleep(0.005)

        def publish(message=None, raw=None):
            nonlocal sent
            sent += 1
            payload = raw if raw is not None else bytes(TYPES.serialize_cdr(message, type_))
            publisher.put(payload, attachment=struct.pack("<qqB", sent, time.time_ns(), 16) + gid)

        return publish

    def listen(self, topic, type_, take, latched=False):
        """Call `take` with every message and its attachment: sequence number, stamp, id."""
        self._token("MS", topic, type_, TYPES.hash_rihs01(type_), latched)

        def heard(sample):
            attached = sample.attachment.to_bytes()
            take(
                TYPES.deserialize_cdr(sample.payload.to_bytes(), type_),
                (*struct.unpack_from("<qqB", attached), attached[17:]),
            )

        if not latched:
            self.kept.append(
                self.session.declare_subscriber(self.key(topic, type_), Callback(heard, indirect=False))
            )
            return
        history, recovery = (
            ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
            ext.RecoveryConfig(heartbeat=True),
        )
        subscriber = ext.declare_advanced_subscriber(
            self.session,
            self.key(topic, type_),
            Callback(heard, indirect=False),
            history=history,
            recovery=recovery,
            subscriber_detection=True,
        )
        self.kept.insert(0, subscriber)

    def graph(self):
        """Return (node, kind, topic, type, hash, quality) of all that is there."""
        found = []
        for reply in self.session.liveliness().get(
            f"@ros2_lv/{self.domain}/**", FifoChannel(10_000), timeout=60
        ):
            parts = str(reply.ok.key_expr).split("/")
            found.append(
                (parts[8], parts[5], *([parts[9].replace("%", "/"), *parts[10:]] if len(parts) > 9 else []))
            )
        return found

    def call(self, topic, type_, request):
        """Return the response of a service, and the attachments that went and came; the hash of the service
        is that which its server tells.
        """
        server = next(entry for entry in self.graph() if entry[1:3] == ("SS", topic))
        package, _, name = type_.split("/")
        payload = bytes(TYPES.serialize_cdr(request, f"{package}/msg/{name}_Request"))
        went = struct.pack("<qqB", 7, time.time_ns(), 16) + os.urandom(16)
        key = f"{self.domain}/{topic.strip('/')}/{dds(type_)}/{server[4]}"
        options = {
            "target": zenoh.QueryTarget.ALL_COMPLETE,
            "consolidation": zenoh.ConsolidationMode.NONE,
            "timeout": 10.0,
        }
        (reply,) = self.session.get(key, payload=payload, attachment=went, **options)
        if reply.err is not None:
            raise ValueError(reply.err.payload.to_string())
        return (
            TYPES.deserialize_cdr(reply.ok.payload.to_bytes(), f"{package}/msg/{name}_Response"),
            went,
            reply.ok.attachment.to_bytes(),
        )


def built(store, type_, fields):
    """Return a message of rosbags from nested dictionaries."""
    return store.types[type_](
        **{name: _value(store, desc, fields[name]) for name, desc in store.fielddefs[type_][1]}
    )


def _value(store, desc, value):
    kind, rest = desc
    if kind == Nodetype.NAME:
        return built(store, rest, value)
    if kind == Nodetype.BASE:
        return value
    (of, what), _ = rest
    if of == Nodetype.NAME:
        return [built(store, what, one) for one in value]
    return (
        list(value)
        if what[0] == "string"
        else np.array(value, {"byte": "uint8", "char": "uint8", "octet": "uint8"}.get(what[0], what[0]))
    )


def flat(message):
    """Return a message of rosbags as nested dictionaries."""
    if isinstance(message, list):
        return [flat(one) for one in message]
    if not is_dataclass(message):
        return message
    return {
        field.name: flat(getattr(message, field.name))
        for field in fields_of(message)
        if not field.name.startswith("__") and not str(field.type).startswith("ClassVar")
    }


def main(endpoint, domain):
    with opened(endpoint) as session:
        session.declare_subscriber(f"{domain}/**", Callback(lambda _: None, indirect=False))
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        sys.stdin.read()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
