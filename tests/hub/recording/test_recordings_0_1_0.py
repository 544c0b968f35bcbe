"""What version 0.1.0 recorded is read and verified by this one, whatever names have changed since."""

import lzma
from collections import defaultdict
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from hub.recording.output_port import output_port
from hub.recording.recording import Recording
from hub.verify import verify
from schemas.codec import decode
from schemas.vectors import Vector, VectorCodec, has_vector

FILES = sorted((Path(__file__).parent / "recordings_0_1_0").glob("*.mcap.xz"))
KINDS = {
    "palpation": {"bullet", "mujoco", "scripted", "teleoperation"},
    "pick": {"motion", "mujoco", "routine"},
    "retraction": {"bullet", "endoscope", "motion", "mujoco", "routine"},
    "rolling": {"motion", "mujoco", "rolling-study", "routine"},
    "ros-mirror": {"mirror", "motion", "mujoco", "ros-bag"},
    "table": {"mujoco", "simulated-touch", "teleoperation"},
    "teleop": {
        "ecm-teleoperation",
        "endoscope",
        "motion",
        "mujoco",
        "scripted",
        "simulated-touch",
        "teleoperation",
    },
}


@pytest.fixture(params=FILES, ids=[file.name.partition(".")[0] for file in FILES])
def recorded(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[str, Recording]:
    packed: Path = request.param
    name = packed.name.partition(".")[0]
    unpacked = tmp_path / f"{name}.mcap"
    unpacked.write_bytes(lzma.decompress(packed.read_bytes()))
    return name, Recording(unpacked)


def test_there_are_recordings() -> None:
    assert {file.name.partition(".")[0] for file in FILES} == {*KINDS, "ros", "ros-paper"}


def test_an_old_recording_is_read(recorded: tuple[str, Recording]) -> None:
    name, recording = recorded
    scenario, plan = recording.scenario(), recording.plan()
    kinds = {participant.kind for participant in scenario.participants.values()}
    assert kinds == KINDS.get(name, kinds)
    assert plan.step_ns == scenario.step
    assert {*plan.order} <= {*scenario.participants}
    assert recording.versions()["trocar"] == "0.1.0"
    assert recording.session()
    assert recording.started_ns() > 0

    assert scenario.duration is not None
    granted = [(grant.start_ns, grant.horizon_ns) for grant in recording.grants()]
    assert (granted[0][0], granted[-1][1]) == (0, scenario.duration)
    assert all(horizon == start for (_, horizon), (start, _) in pairwise(granted))
    for participant in plan.order:
        assert sum(len(ack.state_hash) for ack in recording.acks(participant)) > 0
    codecs: dict[str, VectorCodec] = {}
    rows: defaultdict[str, list[Vector]] = defaultdict(list)
    for message in recording.messages():
        if has_vector(message.type):
            topic = message.topic
            if topic not in codecs:
                codecs[topic] = VectorCodec(output_port(topic, message.type, message.payload))
            codec = codecs[topic]
            rows[topic].append(codec.from_message(decode(codec.model, message.payload)))
    assert rows
    for topic, values in rows.items():
        series = recording[topic]
        assert len(series.time) == len(series) == recording.counts[topic]
        assert np.array_equal(series.values, values)


@pytest.mark.long
def test_an_old_recording_is_verified(recorded: tuple[str, Recording]) -> None:
    _, recording = recorded
    summary = verify(recording)
    assert summary.same, summary
    assert summary.hashes > 0
