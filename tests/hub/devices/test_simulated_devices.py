"""Devices in simulated time with inputs: the same bits wherever their sources run, and over a link."""

import pytest

from hub.recording.recording import Recording
from hub.verify import verify

SCENARIO = """\
name: handed
step: 1 ms
duration: 60 ms
participants:
  hand: {kind: "toys:Hand", period: 3 ms}
  mixer: {kind: "toys:Mixer", period: 2 ms, step_ns: 2000000}
  talker: {kind: "toys:Talker"}
  other: {kind: "toys:Mixer", seed: 2}
connections:
  - hand.out -> mixer.a
  - mixer.out -> hand.numbers
  - talker.words -> hand.words
  - mixer.out -> other.a
measure:
  last: {kind: final, of: hand.out}
"""
PLACEMENTS = (
    ("window=1",),
    ("window=7",),
    ("participants.mixer.host=far",),
    ("participants.talker.host=far", "participants.mixer.host=farther", "window=20"),
)


def run(prepare, *overrides, **options):
    summary = prepare(SCENARIO, *overrides, **options).run()
    return summary.state_hash, summary.measures["last"]


@pytest.mark.long
def test_the_same_bits_wherever_its_sources_run(prepare):
    first, *others = [run(prepare, *placement) for placement in PLACEMENTS]
    assert others == [first] * len(others)
    assert first != run(prepare, "participants.hand.period=4 ms")


LINK = (
    "participants.hand.network_link="
    "{delay: 5 ms, jitter: 4 ms, loss: 0.2, outages: [{at: 30 ms, duration: 6 ms}], seed: 3}"
)


@pytest.mark.long
def test_a_network_link_gives_the_same_bits_too(prepare):
    first = run(prepare, LINK)
    assert run(prepare, LINK, *PLACEMENTS[-1]) == first
    assert run(prepare, LINK.replace("seed: 3", "seed: 4")) != first


@pytest.mark.long
def test_a_session_with_a_link_is_re_simulated(prepare, tmp_path):
    summary = prepare(SCENARIO, LINK, "participants.mixer.host=far", record=tmp_path / "recording").run()
    assert summary.recording_complete
    recording = Recording(tmp_path / "recording")
    times = [message.time_ns for message in recording.messages("/device/hand/out/unused")]
    assert times == sorted(times)
    assert len(times) > 5
    verified = verify(recording, trust=True)
    assert (verified.same, verified.steps) == (True, 60)


@pytest.mark.parametrize("delay", [0, 10])
def test_latencies_are_in_simulated_time(prepare, delay):
    overrides = ["participants.hand.period=2 ms"] + (
        [f"participants.hand.network_link.delay={delay} ms"] if delay else []
    )
    latency = prepare(SCENARIO, *overrides).run().latency
    assert latency["device to grant"]["hand.out"]["p50_s"] == pytest.approx(delay * 1e-3, rel=0.02)
    assert latency["state to force"]["hand.numbers"]["p50_s"] == pytest.approx(delay * 1e-3, rel=0.02)
    assert latency["grant to state"]["all participants"]["count"] >= 30
