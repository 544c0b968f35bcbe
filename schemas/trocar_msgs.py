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
    Int32,
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
from schemas.ros import Header, Point, Vector3

__all__ = [
    "AckMessage",
    "ActionChunk",
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
    "PolicyObservation",
    "Profile",
    "ProfileRow",
    "RuleScore",
    "ScoreCard",
    "ScoreValue",
    "SessionStatus",
    "ShownMarkers",
    "SoftBodyState",
    "SurfaceChange",
    "SurfaceFilm",
    "TaskEvent",
    "TiedPlaces",
    "TissueEvent",
    "TissueGrasp",
    "TubeClips",
    "TubeEvent",
    "TubeLine",
]


class InletSample(Message):
    """A device sample as it enters simulated time: its CDR bytes, or only a change of staleness."""

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
    """A participant has done the steps of a grant. The arrays hold an entry for each of its steps."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/Ack"
    run: UInt64
    epoch: UInt32
    step: Int64
    """First step of the acknowledged grant; -1: the participant is configured and ready."""
    state_hash: UInt64Array = Field(default_factory=lambda: np.zeros(0, np.uint64))
    compute_ns: UInt64Array = Field(default_factory=lambda: np.zeros(0, np.uint64))
    work_j: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Per step, per bond in declared order: work since the start (J), done by a motion side, received by a
    force side.
    """
    error: String = ""


class CouplingEnergy(Message):
    """The energy book of a bond, J since the start: work given, work received, difference."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/CouplingEnergy"
    header: Header
    bond: String
    motion_work_j: Float64
    force_work_j: Float64
    residual_j: Float64
    """`force_work_j - motion_work_j`: energy created (positive) or lost by the coupling."""


class ContactPlane(Message):
    """A surface near a hand, taken as flat: a hand below the plane is pushed back along the normal.

    With depth = distance + velocity age - normal . x of a hand at x, the force is normal max(0, stiffness
    depth - damping v_n), and friction across it.
    """

    ros_type: ClassVar[str] = "trocar_msgs/msg/ContactPlane"
    normal: Vector3
    """Unit vector out of the body, towards the free side."""
    distance: Float64
    """Distance of the surface from the frame's origin along the normal at the stamp of the model, m."""
    velocity: Float64 = 0.0
    """Velocity of the surface along its normal, m/s."""
    stiffness: Annotated[Float64, Field(ge=0.0)]
    """Contact stiffness, N/m."""
    damping: Annotated[Float64, Field(ge=0.0)] = 0.0
    """Contact damping, N s/m."""
    friction: Annotated[Float64, Field(ge=0.0)] = 0.0
    """Coefficient of Coulomb friction."""


class ContactModel(Message):
    """Contact as a haptic device renders it until the next model arrives.

    The frame in `header.frame_id` is the device's base frame.
    """

    ros_type: ClassVar[str] = "trocar_msgs/msg/ContactModel"
    header: Header
    planes: Annotated[list[ContactPlane], Field(max_length=4)] = Field(default_factory=list[ContactPlane])
    """Planes near the hand; empty: the hand is free."""


class SoftBodyState(Message):
    """The nodes of a soft body: x, y, z in metres, one after the other, in `header.frame_id`."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/SoftBodyState"
    header: Header
    body: String
    nodes_m: Float32Array = Field(default_factory=lambda: np.zeros(0, np.float32))
    triangles: UInt32Array = Field(default_factory=lambda: np.zeros(0, np.uint32))
    """Surface triangles as node indices, three after the other; sent with the first state, empty afterwards.
    """


class SurfaceChange(Message):
    """Difference of the surface of a soft body from the triangles of its first `SoftBodyState`.

    Every message is complete: the newest message and the first triangles make the surface. Nodes are only
    ever appended, and faces keep their slot, the place in the list of faces: the first slots are those of the
    triangles.
    """

    ros_type: ClassVar[str] = "trocar_msgs/msg/SurfaceChange"
    header: Header
    """Time of the newest change."""
    body: String
    version: UInt64 = 0
    """Count of the changes: equal versions of a run are equal surfaces. 0: the triangles."""
    slots: UInt32Array = Field(default_factory=lambda: np.zeros(0, np.uint32))
    """Slots of the changed and appended faces, ascending."""
    faces: Int32Array = Field(default_factory=lambda: np.zeros(0, np.int32))
    """Node indices of each of these faces, three after the other; three times -1: the face is gone."""
    kinds: Bytes = Field(default_factory=lambda: np.zeros(0, np.uint8))
    """Kind of tissue of each of these faces: 0 outside, 1 inside of a cut, 2 coagulated, 3 charred."""
    origins: UInt32Array = Field(default_factory=lambda: np.zeros(0, np.uint32))
    """Node of the first state at the resting place of each appended node."""


class SurfaceFilm(Message):
    """Liquid on the surface of a soft body: every message is complete."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/SurfaceFilm"
    header: Header
    body: String
    liquid: String
    """`blood` or `bile`."""
    nodes: UInt32Array = Field(default_factory=lambda: np.zeros(0, np.uint32))
    """Wet nodes, ascending."""
    thickness: Bytes = Field(default_factory=lambda: np.zeros(0, np.uint8))
    """Thickness of the film at each of these nodes, in steps of 10 um; 255: 2.55 mm or more."""


class TiedPlaces(Message):
    """Where an attachment still ties its two organs together."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/TiedPlaces"
    header: Header
    attachment: String
    points_m: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Middle between the two organs at each whole tie in `header.frame_id`: x, y, z, one after the other."""
    areas_m2: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Area that each of these ties stands for."""


class TubeLine(Message):
    """Middle line of an organ with a lumen, from its left end to its right: a row for each ring of nodes."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/TubeLine"
    header: Header
    body: String
    points_m: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Present middle of each ring in `header.frame_id`: x, y, z, one after the other."""
    along_m: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Distance of each ring from the first ring along the line at rest."""
    areas_m2: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Present open cross-section of each ring, 0 under a clip, m^2."""
    diameters_m: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Outer diameter of each ring at rest."""
    shut: Bytes = Field(default_factory=lambda: np.zeros(0, np.uint8))
    """1: a clip shuts the ring."""
    parted: Bytes = Field(default_factory=lambda: np.zeros(0, np.uint8))
    """1: the tube is parted between this ring and the next."""


class TubeClips(Message):
    """All clips that have closed on a tube since time 0."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/TubeClips"
    header: Header
    body: String
    numbers: Int32Array = Field(default_factory=lambda: np.zeros(0, np.int32))
    """Number of each clip on this tube, from 0 in the order of closing."""
    along_m: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Place of each clip as in `TubeLine.along_m`."""
    on: Bytes = Field(default_factory=lambda: np.zeros(0, np.uint8))
    """1: the clip is on the tube and shuts it; 0: it was pulled off."""
    instruments: StringArray = Field(default_factory=list[str])
    """Probe that closed each clip."""


class TubeEvent(Message):
    """Something happened to a tube: a clip, or a parting."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/TubeEvent"
    header: Header
    kind: String
    """`clipped`, `clip slipped`, `clip not across`, `clip pulled off`, `perforated` (the wall is open) or
    `parted`.
    """
    body: String
    instrument: String = ""
    """Name of the probe; empty: none."""
    position: Point = Field(default_factory=Point)
    """Place, m, in `header.frame_id`."""
    along_m: Float64 = 0.0
    """Place along the tube at rest, as in `TubeLine.along_m`."""
    clip: Int32 = -1
    """Number of the clip as in `TubeClips`; -1: none."""
    others: StringArray = Field(default_factory=list[str])
    """Other organs between the jaws of a clip."""
    cause: String = ""
    """Why a clip slipped; whether a tube was `cut`, `torn` or `burnt` open or apart."""
    left_clips: UInt32 = 0
    """Clips on the tube on the left of a parting, up to its end or the next parting."""
    right_clips: UInt32 = 0
    """The same on the right."""


class ShownMarkers(Message):
    """All markers of a scene at an instant, as arrays: a camera draws them without earlier messages.

    A marker locked to its frame is in that frame, any other in `world`. m, quaternions (x, y, z, w), colours
    (r, g, b, a) from 0 to 1.
    """

    ros_type: ClassVar[str] = "trocar_msgs/msg/ShownMarkers"
    header: Header
    """Header with the stamp of the last change."""
    namespaces: StringArray = Field(default_factory=list[str])
    """Namespaces of the n markers; namespace and id together name a marker."""
    ids: Int32Array = Field(default_factory=lambda: np.zeros(0, np.int32))
    types: Bytes = Field(default_factory=lambda: np.zeros(0, np.uint8))
    """Types of visualization_msgs/Marker."""
    frames: StringArray = Field(default_factory=list[str])
    poses: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Seven numbers each: position, quaternion."""
    scales_m: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Three numbers each."""
    colors: Float32Array = Field(default_factory=lambda: np.zeros(0, np.float32))
    """Four numbers each."""
    expires_ns: UInt64Array = Field(default_factory=lambda: np.zeros(0, np.uint64))
    """Simulated time at which each marker vanishes; 0: never."""
    texts: StringArray = Field(default_factory=list[str])
    """Text of each marker, or the name of the object with the same shape."""
    point_counts: UInt32Array = Field(default_factory=lambda: np.zeros(0, np.uint32))
    """Number of points of each marker."""
    points_m: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """x, y, z in the markers' own frames, one marker after the other."""
    color_counts: UInt32Array = Field(default_factory=lambda: np.zeros(0, np.uint32))
    """Number of point colours of each marker: as many as points, or 0."""
    point_colors: Float32Array = Field(default_factory=lambda: np.zeros(0, np.float32))
    """Colours (r, g, b, a) of the points of markers with a colour per point."""


class TissueGrasp(Message):
    """An instrument has taken hold of tissue, or has lost it."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/TissueGrasp"
    header: Header
    event: String
    """`grasped`, `released` (the fingers opened), `torn` (the pull was too strong), or `exchanged while
    holding` (the instrument was taken out of the arm, and the tissue slid off).
    """
    body: String
    nodes: UInt32Array = Field(default_factory=lambda: np.zeros(0, np.uint32))
    """Indices of the nodes held, or held until now."""
    force_n: Float64
    """Pull of the instrument on the tissue just before."""


class TissueEvent(Message):
    """A lasting change of tissue. Changes made one after the other by an instrument are one event."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/TissueEvent"
    header: Header
    """Time of the end of the change; frame `world`."""
    kind: String
    """`cut` or `torn`, with the area of the opened faces; `burnt` (coagulated, charred or vaporised), with
    the volume; `bleeding`, with its flow, and `bleeding stopped`, with the volume lost by then, of bile
    `leaking` and `leaking stopped`; `clipped`, with the width of the clip, `clip slipped` and
    `clip not across`, with the diameter of the tube, and `clip pulled off`, with the force; `detached` from
    another organ, `perforated` (the wall of a lumen is open), with the area.
    """
    instrument: String = ""
    """Name of the probe; empty: none."""
    position: Point = Field(default_factory=Point)
    """Mean place of the change, m."""
    size: Float64 = 0.0
    """Amount, in `unit`, of the resting shape."""
    unit: String = ""


class TaskEvent(Message):
    """An event of a training task."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/TaskEvent"
    header: Header
    event: String
    """`grasped`, `lifted`, `handed over`, `placed`, `dropped`, `out of workspace`, `out of view` or
    `collision`; of a needle in a phantom also `entered`, `exited`, `stitched` (or, from the tissue itself,
    `pulled out`) and `withdrawn`; of tissue `cut`, `torn` and `burnt`; of an operation phases, goals and
    errors (docs/scores.md).
    """
    object: String = ""
    """Name of the object; empty: none."""
    arm: String = ""
    """Name of the acting arm, after a hand-over of the receiving arm; empty: none."""
    place: String = ""
    """Place where an object was put; of an operation the organ, or the phase that begins."""
    value: Float64 = 0.0
    """Height of a lift or a drop, or impulse of a collision, in `unit`."""
    unit: String = ""


class PolicyObservation(Message):
    """The readings with which a policy is asked for actions; pictures go beside."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/PolicyObservation"
    header: Header
    """Simulated time of the readings."""
    number: UInt32
    """Number of the observation, from 1."""
    state: Float64Array
    """State in the layout of the contract."""
    tips: Float64Array
    """Pose of each arm's tip (x, y, z, qx, qy, qz, qw), one after the other, m."""


class ActionChunk(Message):
    """An answer of a policy: rows of actions in the layout of the contract, or a fault."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/ActionChunk"
    header: Header
    """Simulated time of the observation."""
    number: UInt32
    """Number of the observation."""
    width: UInt32
    """Numbers in a row."""
    actions: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Rows, one after the other; row i is to be reached i + 1 periods of the contract after the observation.
    """
    tips: Float64Array = Field(default_factory=lambda: np.zeros(0))
    """Poses of the tips at the observation."""
    fault: String = ""
    """Why there are no actions; empty: there are."""
    inference_ns: Int64 = 0
    """Wall time from question to answer; for information only."""


class ScoreValue(Message):
    """A number of a score card."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/ScoreValue"
    name: String
    """Name of the number, such as `drops` or, for a single arm, `PSM1/path_length`."""
    value: Float64 = 0.0
    """Value in `unit`; without meaning where there is a `reason`."""
    unit: String = ""
    reason: String = ""
    """Reason for a missing value; empty: the value is valid."""


class RuleScore(Message):
    """Scores of a trial by one set of rules."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/RuleScore"
    rules: String
    values: list[ScoreValue] = Field(default_factory=list[ScoreValue])


class ScoreCard(Message):
    """Progress of a training task: metrics, and the scores by each set of rules."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/ScoreCard"
    header: Header
    task: String
    """Kind of the task."""
    goals: UInt32
    """Number of goals of the task."""
    reached: UInt32
    """Goals reached so far."""
    metrics: list[ScoreValue] = Field(default_factory=list[ScoreValue])
    rules: list[RuleScore] = Field(default_factory=list[RuleScore])


class ParticipantStatus(Message):
    """Host, process and step of a participant."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/ParticipantStatus"
    name: String
    role: String
    host: String
    pid: UInt32
    step: Int64


class Latency(Message):
    """Times of the messages of a stream on one part of their way, since the start of the session."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/Latency"
    way: String
    """`device to grant`: from the sample of a device to the communication point of its entry;
    `grant to state`: from a grant to the acknowledgement of all its steps; `state to force`: from a computed
    value to its writing to a device; `state to picture`: from a computed state to the published picture of
    an observer.
    """
    stream: String
    """`device.port`, `source.port -> device.port`, the observer, or `all participants`."""
    count: UInt64
    p50_s: Float64
    p99_s: Float64
    largest_s: Float64


class DeviceStatus(Message):
    """Report of the host of a device, once a second."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/DeviceStatus"
    device: String
    offset_ns: Int64 = 0
    """Monotonic clock of the hub minus the monotonic clock of the device's host."""
    round_trip_ns: Int64 = -1
    """Round trip of the exchange that measured the offset; half of the round trip bounds the error.

    -1: there was no exchange yet, or the device is in the hub's process.
    """
    link: String = ""
    """The network link between device and hub, as the scenario or a later change sets it; empty: none."""
    latencies: list[Latency] = Field(default_factory=list[Latency])


class ObserverStatus(Message):
    """Report of the host of an observer, once a second. An observer looks on in its own time."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/ObserverStatus"
    observer: String
    step: Int64
    """Communication step of the last observed state; -1: none."""
    states: UInt64
    """Number of observed states; a camera has drawn each state."""
    dropped: UInt64
    """Number of due states not observed, because observer or network were too slow."""
    rate: Float64
    """Observed states per second of wall time, from the session's start to the last state."""
    attainable_rate: Float64
    """States per second that the observer could have processed, from its time per state."""
    latencies: list[Latency] = Field(default_factory=list[Latency])


class SessionStatus(Message):
    """State of a session."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/SessionStatus"
    session: String
    run: UInt64
    state: String
    """An of `starting`, `running`, `paused`, `done`, `failed`."""
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
    """Time spent in a phase of the step thread of a host, or in a group of threads, since the first step."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/ProfileRow"
    host: String
    taker: String
    """User of the time: `participant NAME`, `device NAME`, `hub`, `connections`, `wire`, `recorder` and the
    like.
    """
    phase: String = ""
    """Phase of the step thread; empty for the remaining threads."""
    wall_s: Float64 = 0.0
    """Wall time of a phase."""
    core_s: Float64
    """Processor time."""


class LateCause(Message):
    """Number of steps late for one cause."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/LateCause"
    cause: String
    steps: UInt64


class LateStep(Message):
    """A step longer than its simulated time."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/LateStep"
    time_ns: Int64
    """Simulated time at the end of the step."""
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
    """Causes, the most frequent first."""
    worst: list[LateStep] = Field(default_factory=list[LateStep])
    """The longest steps, the longest first."""


class GatewayClient(Message):
    """A ROS program connected to a gateway."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/GatewayClient"
    name: String
    address: String = ""


class GatewayTopic(Message):
    """Traffic of one ROS topic or service of a gateway."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/GatewayTopic"
    topic: String
    way: String
    """`publish`, `subscribe` or `serve`, seen from the gateway."""
    rate: Float64 = 0.0
    """Messages per second of late."""
    messages: UInt64 = 0
    refused: UInt64 = 0
    reason: String = ""
    """Reason of the last refusal."""


class GatewayStatus(Message):
    """Clients and traffic of a gateway to ROS."""

    ros_type: ClassVar[str] = "trocar_msgs/msg/GatewayStatus"
    kind: String
    clients: list[GatewayClient] = Field(default_factory=list[GatewayClient])
    topics: list[GatewayTopic] = Field(default_factory=list[GatewayTopic])
    """Topics and services with traffic."""
