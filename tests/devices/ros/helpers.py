"""What tests of several gateways share: joint positions as fields, and samples of a topic."""

import time


def joint_fields(values, stamp_ns=None):
    """Return the fields of a JointState as nested dictionaries, stamped now by default."""
    sec, nanosec = divmod(time.time_ns() if stamp_ns is None else stamp_ns, 10**9)
    header = {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": ""}
    return {"header": header, "name": [], "position": list(values), "velocity": [], "effort": []}


def wanted(gateway, topic):
    """Return whether the gateway takes a state for wanted by a program."""
    return next(publish.wanted for state, publish in gateway._optional if state.port.name == topic[1:])


def received(gateway, topic):
    """Return the samples of `topic` that the gateway reads now."""
    return [sample for sample in gateway.read(0) if sample.port == topic[1:]]
