"""What a process that has the secret of a session can send to it: garbage is counted, logged and dropped, and
changes nothing.
"""

import logging
import struct
import threading
from contextlib import contextmanager
from pathlib import Path
from time import sleep

import numpy as np
import pytest
import zenoh
from zenoh.handlers import Callback, RingChannel

from hub.recording.recording import Recording
from hub.remote.hub_connection import reach
from hub.session.startup import start
from hub.transport.host_link import has_link
from hub.transport.zenoh_session import open_session
from schemas.codec import encode
from schemas.ros import Header, Joy, PoseStamped
from tests.hub.conftest import Prepare

SCENARIO = """\
name: target
step: 1 ms
duration: 400 ms
participants:
  pace: {kind: "toys:Paced", milliseconds: 2}
  away: {kind: "toys:Mixer", host: other}
  talker: {kind: "toys:Talker", host: other}
  listener: {kind: "toys:Listener", period: 2 ms}
  far_listener: {kind: "toys:Listener", host: third}
  player: {kind: "toys:Player"}
  follower: {kind: "toys:Follower", host: other}
  idle_player: {kind: "toys:Player", clock: wall, period: 5 ms}
  deaf: {kind: "toys:Deaf", host: other}
order: [pace, away]
connections:
  - pace.out -> away.a
  - away.out -> pace.a
  - talker.words -> listener.words
  - talker.words -> far_listener.words
  - player.hand -> follower.hand
  - player.buttons -> follower.buttons
  - idle_player.hand -> deaf.hand
  - idle_player.buttons -> deaf.buttons
measure:
  heard: {kind: final, of: far_listener.heard}
"""
PREFIX = "trocar/target"
HEARD = [
    *(() if has_link("other") else (f"{PREFIX}/hub/grant",)),
    *(
        f"{PREFIX}/engine/{name}/ack"
        for name in ("away", "talker", "far_listener", "follower", "nobody", "hub")
    ),
    *(f"{PREFIX}/engine/{output}" for output in ("away/out/out", "talker/out/words")),
    *(() if has_link("other") else (f"{PREFIX}/engine/pace/out/out",)),
    f"{PREFIX}/engine/far_listener/out/heard",
    *(f"{PREFIX}/device/idle_player/out/{port}" for port in ("hand", "buttons")),
]
"""Keys of this session that have a subscriber."""
UNHEARD = [
    f"{PREFIX}/engine/away/refused",  # counted, but the log shows the first refusals only, and those are real
    f"{PREFIX}/hub/status",
    f"{PREFIX}/device/player/out/hand",  # it plays in the hub's own time
    f"{PREFIX}/engine/nobody/out/nothing",
    *((f"{PREFIX}/engine/pace/out/out",) if has_link("other") else ()),  # its reader has a socket
    f"{PREFIX}/engine/pace/out",
    f"{PREFIX}/alive/hub/hub",
    f"{PREFIX}/control/shutdown",
    "trocar/other/hub/grant",
]
ALL_AT_ONCE = [f"{PREFIX}/**", f"{PREFIX}/engine/*/ack", f"{PREFIX}/device/*/out/*", "**"]
VERBS = ["join", "pause", "resume", "step", "set", "shutdown"]
GARBAGE = [b"", b"\x00", b"\x00\x01\x00\x00", bytes(range(256)), b"\x00\x01\x00\x00" + b"\xff" * 60]
OVERSIZED = b"\x00\x01\x00\x00" + bytes(20 * 2**20)
_POSE = encode(PoseStamped(header=Header(frame_id="stylus_base")))
_ELSEWHERE = encode(PoseStamped(header=Header(frame_id="elsewhere")))
_JOY = encode(Joy(buttons=np.array([3], np.int32)))
BAD_SAMPLES = {
    "hand": [
        _POSE[:-1],
        _POSE + bytes(9),
        _POSE[:-8] + struct.pack("<d", float("nan")),
        _POSE[:-8] + bytes(8),
        _ELSEWHERE,
        _JOY,
    ],
    "buttons": [_JOY[:-1], _JOY + bytes(9), _POSE],
}


class Stranger:
    """A client that listens to a session and sends it garbage, and real messages cut short or filled with
    NaN.
    """

    def __init__(self, session: zenoh.Session):
        self._session = session
        self._newest: dict[str, zenoh.Sample] = {}
        self._watch = session.declare_subscriber(f"{PREFIX}/**", Callback(self._take))
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self.rounds = 0

    def _take(self, sample):
        self._newest[str(sample.key_expr)] = sample

    def _run(self):
        while not self._tags() and not self._ending.is_set():
            sleep(0.01)
        while not self._ending.is_set():
            self._send_garbage()
            for _ in range(10):
                self._distort()
                sleep(0.01)
            self.rounds += 1

    def _tags(self) -> list[zenoh.ZBytes]:
        return [sample.attachment for sample in list(self._newest.values()) if sample.attachment is not None]

    def _send_garbage(self):
        tags = self._tags()
        for key in (*HEARD, *UNHEARD, *ALL_AT_ONCE):
            for payload in GARBAGE:
                for attachment in (None, b"short", tags[0]):
                    self._session.put(key, payload, attachment=attachment)
        for key in HEARD if self.rounds == 0 else ():
            self._session.put(key, OVERSIZED, attachment=tags[0])
        for port, samples in BAD_SAMPLES.items():
            for payload in samples:
                self._session.put(f"{PREFIX}/device/idle_player/out/{port}", payload)
        for verb in VERBS:
            for payload in GARBAGE[1:]:
                self._session.get(f"{PREFIX}/control/{verb}", payload=payload, handler=RingChannel(1))

    def _distort(self):
        """Send the newest real messages again: cut short, with a NaN at the end, and with a tail."""
        for key, sample in list(self._newest.items()):
            if key.endswith("/ack"):  # what is left of one may be a forged ack, which ends a session
                continue
            payload = sample.payload.to_bytes()
            for distorted in (
                payload[:-1],
                payload[: len(payload) // 2],
                payload[:-8] + struct.pack("<d", float("nan")),
                payload + b"\x00" * 9,
            ):
                if key in HEARD and distorted and distorted != payload:
                    self._session.put(key, distorted, attachment=sample.attachment)

    @contextmanager
    def sending(self):
        self._thread.start()
        try:
            yield
        finally:
            self._ending.set()
            self._thread.join()
            self._watch.undeclare()


@pytest.mark.search
def test_garbage_on_every_key_changes_nothing(prepare: Prepare, tmp_path, monkeypatch, caplog, capfd):
    undisturbed = prepare(SCENARIO).run()
    assert undisturbed.dropped_messages == 0
    session = prepare(SCENARIO, record=tmp_path / "recording")  # so that the hub listens to all outputs
    session.state.step(390)  # the last steps wait until the stranger has sent all
    strangers = []

    def attack():
        try:
            with reach(session.endpoint, "stranger") as client:
                strangers.append(Stranger(client))
                with strangers[0].sending():
                    while strangers[0].rounds < 2 and not over.wait(0.01):
                        pass
                    session.state.resume()
                    over.wait()
        finally:
            session.state.resume()

    over = threading.Event()
    attacker = threading.Thread(target=attack)

    def start_and_attack(run):
        start(run)
        attacker.start()

    monkeypatch.setattr("hub.session.session.start", start_and_attack)
    with caplog.at_level(logging.WARNING):
        try:
            summary = session.run()
        finally:
            over.set()
            attacker.join()
    assert strangers[0].rounds > 1
    assert summary.state_hash == undisturbed.state_hash
    assert summary.measures == undisturbed.measures
    assert summary.dropped_messages > 1000
    log = caplog.text + capfd.readouterr().err
    missing = [
        key
        for key in (*HEARD, *(f"{PREFIX}/control/{verb}" for verb in VERBS))
        if f"dropped a message on {key}" not in log
    ]
    assert missing == []
    assert [grant.step for grant in Recording(tmp_path / "recording").grants()] == list(range(400))


def test_no_shared_memory_is_used():
    with open_session("peer", listen=["tcp/127.0.0.1:0"]):
        assert ".zenoh" not in Path("/proc/self/maps").read_text()
