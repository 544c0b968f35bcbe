"""Trocar's own messages (ROS 2 package `trocar_msgs`), only where no standard type exists."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from schemas.message import (
    Bool,
    Bytes,
    Float32Array,
    Float64,
    Float64Array,
    Int32Array,
    Int64,
    Message,
    String,
    StringArray,
    UInt32,
    UInt32Array,
    UInt64,
    UInt64Array,
)
from schemas.ros import Header, Vector3

__all__ = [
    "AckMessage",
    "ContactModel",
    "ContactPlane",
    "CouplingEnergy",
    "DeviceStatus",
    "GatewayClient",
    "GatewayStatus",
    "GatewayTopic",
    "GrantMessage",
    "InletSample",
    "LateCause",
    "LateStep",
    "Latency",
    "ObserverStatus",
    "ParticipantStatus",
    "Profile",
    "ProfileRow",
    "RuleScore",
    "ScoreCard",
    "ScoreValue",
    "SessionStatus",
    "ShownMarkers",
    "SoftBodyState",
    "TaskEvent",
    "TissueGrasp",
]


class InletSample(Message):
    """One device sample as it enters simulated time: its CDR bytes, or only a change of staleness."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/InletSample"
    participant: String
    port: String
    stale: Bool = False
    payload: Bytes = Field(default_factory=lambda: np.zeros(0, np.uint8))
    """CDR of the port's type; empty when only `stale` changed."""
    age_ns: Int64 = 0
    """Wall time between the arrival of the sample and the communication point; for information only."""


class GrantMessage(Message):
    """The hub's permission to advance from `step` at `start_ns` to `horizon_ns`, with all inlet samples."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/Grant"
    run: UInt64
    epoch: UInt32
    step: Int64
    start_ns: Int64
    horizon_ns: Int64
    inlets: list[InletSample] = Field(default_factory=list[InletSample])


class AckMessage(Message):
    """A participant has done the steps of one grant. The arrays hold one entry per step it took in it."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/Ack"
    run: UInt64
    epoch: UInt32
    step: Int64
    """First step of the grant that is acknowledged; -1 says that the participant is configured and ready."""
    state_hash: UInt64Array = Field(default_factory=lambda: np.zeros(0, np.uint64))
    compute_ns: UInt64Array = Field(default_factory=lambda: np.zeros(0, np.uint64))
    work_j: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Per step, per bond in declared order: work since the start (J), done by a motion side, received by a
    force side.
    """
    error: String = ""


class CouplingEnergy(Message):
    """The energy book of one bond, in J since the start.

    It contains what the motion side gave, what the force side received, and the difference.
    """

    ros_type: ClassVar[str] = "trocar_msgs/msg/CouplingEnergy"
    header: Header
    bond: String
    motion_work_j: Float64
    force_work_j: Float64
    residual_j: Float64
    """`force_work_j - motion_work_j`: energy that the coupling created (positive) or lost."""


class ContactPlane(Message):
    """A surface near a hand, as flat: it pushes what is below it back along its normal.

    With depth = distance + velocity age - normal . x of a hand at x, the force is normal max(0, stiffness
    depth - damping v_n), and friction across it.
    """

    ros_type: ClassVar[str] = "trocar_msgs/msg/ContactPlane"
    normal: Vector3
    """Unit vector out of the body, towards where the hand is free."""
    distance: Float64
    """Of the surface from the frame's origin along the normal, m, at the stamp of the model."""
    velocity: Float64 = 0.0
    """Of the surface along its normal, m/s."""
    stiffness: Annotated[Float64, Field(ge=0.0)]
    """N/m."""
    damping: Annotated[Float64, Field(ge=0.0)] = 0.0
    """N s/m."""
    friction: Annotated[Float64, Field(ge=0.0)] = 0.0
    """Coefficient."""


class ContactModel(Message):
    """All that a haptic device needs to render contact until the next one arrives.

    The frame in `header.frame_id` is the device's base frame.
    """

    ros_type: ClassVar[str] = "trocar_msgs/msg/ContactModel"
    header: Header
    planes: Annotated[list[ContactPlane], Field(max_length=4)] = Field(default_factory=list[ContactPlane])
    """None: the hand is free."""


class SoftBodyState(Message):
    """The nodes of a soft body: x, y, z in metres, one after the other, in `header.frame_id`."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/SoftBodyState"
    header: Header
    body: String
    nodes_m: Float32Array = Field(default_factory=lambda: np.zeros(0, np.float32))
    triangles: UInt32Array = Field(default_factory=lambda: np.zeros(0, np.uint32))
    """Surface triangles as node indices, three after the other; sent with the first state, empty afterwards.
    """


class ShownMarkers(Message):
    """All markers of a scene at a time, as arrays: what a camera draws without asking what came before.

    One that moves with its frame is in that frame, any other in `world`. m, quaternions (x, y, z, w), colours
    (r, g, b, a) from 0 to 1.
    """

    ros_type: ClassVar[str] = "trocar_msgs/msg/ShownMarkers"
    header: Header
    """The stamp is of the last change."""
    namespaces: StringArray = Field(default_factory=list[str])
    """With the id, the name of each of the n markers."""
    ids: Int32Array = Field(default_factory=lambda: np.zeros(0, np.int32))
    types: Bytes = Field(default_factory=lambda: np.zeros(0, np.uint8))
    """As in visualization_msgs/Marker."""
    frames: StringArray = Field(default_factory=list[str])
    poses: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Seven numbers each: position, quaternion."""
    scales_m: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Three numbers each."""
    colors: Float32Array = Field(default_factory=lambda: np.zeros(0, np.float32))
    """Four numbers each."""
    expires_ns: UInt64Array = Field(default_factory=lambda: np.zeros(0, np.uint64))
    """Simulated time from which on each is gone; 0: it stays."""
    texts: StringArray = Field(default_factory=list[str])
    """Of each: what is written, or the object whose shape it has."""
    point_counts: UInt32Array = Field(default_factory=lambda: np.zeros(0, np.uint32))
    """How many of the points each has."""
    points_m: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """x, y, z in the markers' own frames, one marker after the other."""
    color_counts: UInt32Array = Field(default_factory=lambda: np.zeros(0, np.uint32))
    """How many of the points' colours each has: as many as points, or none."""
    point_colors: Float32Array = Field(default_factory=lambda: np.zeros(0, np.float32))
    """Four numbers for each point with a colour of its own."""


class TissueGrasp(Message):
    """An instrument has taken hold of tissue, or has lost it."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/TissueGrasp"
    header: Header
    event: String
    """`grasped`, `released` (the fingers opened) or `torn` (the pull was too strong)."""
    body: String
    nodes: UInt32Array = Field(default_factory=lambda: np.zeros(0, np.uint32))
    """The nodes of the body that are, or were, held."""
    force_n: Float64
    """Pull of the instrument on the tissue just before."""


class TaskEvent(Message):
    """Something that happened in a training task."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/TaskEvent"
    header: Header
    event: String
    """`grasped`, `lifted`, `handed over`, `placed`, `dropped`, `out of workspace`, `out of view` or
    `collision`; of a needle in a phantom also `entered`, `exited`, `stitched` (or, from the tissue itself,
    `pulled out`) and `withdrawn`.
    """
    object: String = ""
    """The object of which it is; empty: none."""
    arm: String = ""
    """The arm that did it; of a hand-over the one that has the object now; empty: none."""
    place: String = ""
    """Where an object was placed."""
    value: Float64 = 0.0
    """How much, in `unit`: the height of a lift or a drop, the impulse of a collision."""
    unit: String = ""


class ScoreValue(Message):
    """One number of a score card."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/ScoreValue"
    name: String
    """Such as `drops`; of one arm `PSM1/path_length`."""
    value: Float64 = 0.0
    """In `unit`; it says nothing if there is a `reason`."""
    unit: String = ""
    reason: String = ""
    """Why there is no value; empty: there is one."""


class RuleScore(Message):
    """What one set of rules says about a trial."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/RuleScore"
    rules: String
    values: list[ScoreValue] = Field(default_factory=list[ScoreValue])


class ScoreCard(Message):
    """How well a training task is done so far: metrics, and the scores by each set of rules."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/ScoreCard"
    header: Header
    task: String
    """Kind of the task."""
    goals: UInt32
    """That the task has."""
    reached: UInt32
    """Goals reached so far."""
    metrics: list[ScoreValue] = Field(default_factory=list[ScoreValue])
    rules: list[RuleScore] = Field(default_factory=list[RuleScore])


class ParticipantStatus(Message):
    """Where one participant lives and how far it is."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/ParticipantStatus"
    name: String
    role: String
    host: String
    pid: UInt32
    step: Int64


class Latency(Message):
    """How long the messages of one stream took on one part of their way, since the start of the session."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/Latency"
    way: String
    """`device to grant`: from when a device had a sample to the communication point at which it entered the
    simulation; `grant to state`: from a grant to the acknowledgement of all its steps; `state to force`: from
    when a value was there to when it was written to a device; `state to picture`: from when a state was there
    to when an observer had drawn and published it.
    """
    stream: String
    """`device.port`, `source.port -> device.port`, the observer, or `all participants`."""
    count: UInt64
    p50_s: Float64
    p99_s: Float64
    largest_s: Float64


class DeviceStatus(Message):
    """What the host of a device tells of it, once a second."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/DeviceStatus"
    device: String
    offset_ns: Int64 = 0
    """Added to the monotonic clock of the device's host it gives that of the hub."""
    round_trip_ns: Int64 = -1
    """Of the exchange that measured the offset, which is exact within half of it.

    -1: there was no exchange yet, or the host is the hub's own.
    """
    link: String = ""
    """The network link between device and hub, as the scenario or a later change sets it; empty: none."""
    latencies: list[Latency] = Field(default_factory=list[Latency])


class ObserverStatus(Message):
    """What the host of an observer tells of it, once a second: a participant that looks in its own time."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/ObserverStatus"
    observer: String
    step: Int64
    """The communication step whose state it saw last; -1: none."""
    states: UInt64
    """States that it saw, and drew if it is a camera."""
    dropped: UInt64
    """States at its period that it did not see, because it or the network was too slow."""
    rate: Float64
    """States per second of wall time that it saw, from the session's start to the last one."""
    attainable_rate: Float64
    """States per second that it could have seen, by the time that one took."""
    latencies: list[Latency] = Field(default_factory=list[Latency])


class SessionStatus(Message):
    """What a session is doing now."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/SessionStatus"
    session: String
    run: UInt64
    state: String
    """One of `starting`, `running`, `paused`, `done`, `failed`."""
    step: Int64
    sim_time_ns: Int64
    real_time_factor: Float64
    late_steps: UInt64
    dropped_messages: UInt64
    detail: String = ""
    participants: list[ParticipantStatus] = Field(default_factory=list[ParticipantStatus])
    devices: list[DeviceStatus] = Field(default_factory=list[DeviceStatus])
    latencies: list[Latency] = Field(default_factory=list[Latency])


class ProfileRow(Message):
    """What one phase of a host's stepping thread took, or all threads of one kind of its process.

    Times are sums since the first step.
    """

    ros_type: ClassVar[str] = "trocar_msgs/msg/ProfileRow"
    host: String
    taker: String
    """Who used the time: `participant NAME`, `device NAME`, `hub`, `connections`, `wire`, `recorder` and the
    like.
    """
    phase: String = ""
    """Of the stepping thread; empty for other threads."""
    wall_s: Float64 = 0.0
    """Of the wall clock, for a phase."""
    core_s: Float64
    """Of a processor core."""


class LateCause(Message):
    """How many steps were late for one cause."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/LateCause"
    cause: String
    steps: UInt64


class LateStep(Message):
    """A step that took longer than the time it simulates."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/LateStep"
    time_ns: Int64
    """Simulated time at its end."""
    took_s: Float64
    cause: String


class Profile(Message):
    """Where the time of a session goes, from its first step on."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/Profile"
    session: String
    run: UInt64
    sim_time_ns: Int64
    wall_time_ns: Int64
    steps: Int64
    rows: list[ProfileRow] = Field(default_factory=list[ProfileRow])
    late: list[LateCause] = Field(default_factory=list[LateCause])
    """The most frequent cause first."""
    worst: list[LateStep] = Field(default_factory=list[LateStep])
    """The longest step first; not all."""


class GatewayClient(Message):
    """A ROS program at the other side of a gateway."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/GatewayClient"
    name: String
    address: String = ""


class GatewayTopic(Message):
    """What has gone over one ROS topic or service of a gateway."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/GatewayTopic"
    topic: String
    way: String
    """`publish`, `subscribe` or `serve`, seen from the gateway."""
    rate: Float64 = 0.0
    """Messages per second of late."""
    messages: UInt64 = 0
    refused: UInt64 = 0
    reason: String = ""
    """Why the last one was refused."""


class GatewayStatus(Message):
    """Who is connected to a gateway to ROS, and what goes through it."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/GatewayStatus"
    kind: String
    clients: list[GatewayClient] = Field(default_factory=list[GatewayClient])
    topics: list[GatewayTopic] = Field(default_factory=list[GatewayTopic])
    """Those over which anything has gone."""
