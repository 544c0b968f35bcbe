"""Outputs of a host process are recorded and measured as if the hub had computed them."""

from collections import defaultdict
from pathlib import Path

from hub.recording.recording import Recording
from tests.hub.conftest import Prepare

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
