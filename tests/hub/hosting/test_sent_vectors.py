"""What a host on this machine sends with its acks is recorded and measured as if the hub had computed it."""

from collections import defaultdict
from pathlib import Path

import pytest

from hub.hosting.sent_vectors import VectorsToSend
from hub.observation.measures import Measures
from hub.observation.monitor import Monitor
from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from hub.session.host_vectors import HostVectors
from hub.transport.host_link import has_link
from schemas.errors import ParticipantError
from schemas.keys import Keys
from schemas.ports import Port
from schemas.vectors import VectorCodec
from tests.hub.conftest import Prepare

pytestmark = pytest.mark.skipif(not has_link("other"), reason="hosts have links on Linux alone")

TEXT = """\
name: apart
step: 1 ms
duration: 40 ms
window: 5
order: [near, often, seldom]
participants:
  near: {kind: "toys:Mixer", seed: 1}
  often: {kind: "toys:Mixer", seed: 2, host: other}
  seldom: {kind: "toys:Mixer", seed: 3, period: 2 ms, step_ns: 2000000, out_every: 2, host: other}
  talker: {kind: "toys:Talker", host: other}
connections:
  - near.out -> often.a
  - often.out -> seldom.a
  - often.out -> near.b
measure:
  largest: {kind: peak-norm, of: often.out}
  last: {kind: final, of: seldom.out}
"""
RECORDED = ("near/out/out", "often/out/out", "seldom/out/out", "talker/out/words")


def outputs(directory: Path) -> dict[str, list[tuple[int, bytes]]]:
    found: dict[str, list[tuple[int, bytes]]] = defaultdict(list)
    for message in Recording(directory).messages():
        if "/out/" in message.topic:
            found[message.topic].append((message.time_ns, message.payload))
    return found


def test_a_recording_has_what_it_has_with_all_in_one_process(prepare: Prepare, tmp_path: Path) -> None:
    apart = prepare(TEXT, record=tmp_path / "apart").run()
    together = prepare(TEXT, record=tmp_path / "together", one_host=True).run()
    assert apart.state_hash == together.state_hash
    assert apart.measures == together.measures
    found = outputs(tmp_path / "apart")
    assert found == outputs(tmp_path / "together")
    assert sorted(topic.split("/", 2)[-1] for topic in found) == sorted(RECORDED)
    (often,) = (its for topic, its in found.items() if "often" in topic)
    assert [time_ns for time_ns, _ in often] == [1_000_000 * i for i in range(41)]


def test_measures_alone_need_no_recording(prepare: Prepare) -> None:
    apart, together = (prepare(TEXT, one_host=one).run() for one in (False, True))
    assert apart.measures == together.measures
    assert all(value is not None for value in apart.measures.values())


def test_only_groups_with_a_port_that_is_wanted_are_sent(prepare: Prepare) -> None:
    planned = prepare(TEXT).plan.participants["often"]
    (port,) = (port for port in planned.ports if port.causality == "output")
    kept = VectorsToSend([("often", "out")])
    assert kept.vectors_listener(planned, [Port(name="other", causality="output", size=2)]) is None
    keep = kept.vectors_listener(planned, [port])
    assert keep is not None
    assert kept.groups == [("often", ["out"])]
    keep(3, 4_000_000, b"data")
    assert kept.take() == [(0, 3, 4_000_000, b"data")]
    assert kept.take() == []


def test_vectors_of_another_size_end_the_session(prepare: Prepare, tmp_path: Path) -> None:
    session = prepare(TEXT)
    plan, scenario = session.plan, session.scenario
    size = 8 * VectorCodec(plan.participants["often"].port("out")).size
    with Recorder(tmp_path / "run", attachments={}) as recorder:
        monitor = Monitor(plan, Keys("apart"), 1, Measures(scenario, plan), recorder)
        vectors = HostVectors(plan, monitor, lambda _: [("often", ["out"])])
        vectors.take("other", [(0, 0, 1_000_000, bytes(size))])
        with pytest.raises(ParticipantError, match=f"vectors of {size - 8} bytes, expected {size}"):
            vectors.take("other", [(0, 1, 2_000_000, bytes(size - 8))])
