"""What a device host that stays does when the hub or the network goes, and what a session does without its
device: real processes.
"""

import os
import subprocess
import sys
import threading
from contextlib import ExitStack, contextmanager
from signal import SIGKILL, SIGTERM
from time import sleep

import pytest

from hub.remote.device_host import DeviceHost
from hub.remote.hub_connection import reach
from hub.remote.live_sessions import live_sessions
from hub.transport.control_messages import JoinRequest
from schemas.keys import Keys
from tests.hub.authorities import free_endpoint
from tests.hub.proxy import Proxy
from tests.waiting import LIMIT_S, until

SCENARIO = """\
name: hand
step: 10 ms
pace: realtime
participants:
  player: {kind: "toys:Player", clock: wall, max_age_ms: 100, host: remote}
  deaf: {kind: "toys:Deaf"}
  loud: {kind: "toys:Loud"}
connections:
  - loud.out -> player.noise
  - player.hand -> deaf.hand
  - player.buttons -> deaf.buttons
measure:
  fresh_steps: {kind: final, of: deaf.fresh_steps, live: true}
"""


class Running:
    """A session in this process, in a thread."""

    def __init__(self, session):
        self.session = session
        self.fresh = 0.0
        self.summary = self.failure = None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        try:
            self.summary = self.session.run(
                lambda progress: setattr(self, "fresh", progress.live.get("fresh_steps", (0.0, ""))[0])
            )
        except Exception as error:  # noqa: BLE001
            self.failure = error

    @property
    def status(self):
        """The status, as soon as the hub answers."""
        return until(lambda: next(iter(live_sessions([self.session.endpoint])), None))

    def is_followed(self):
        """Say whether the device's samples are fresh now."""
        before = self.fresh
        sleep(0.4)
        return self.fresh > before

    def end(self):
        self.session.state.shutdown()
        self._thread.join()
        assert self.failure is None


@contextmanager
def player(endpoint, file, *more):
    """Start `trocar device player`; its messages go to a file."""
    command = [
        sys.executable,
        "-P",
        "-m",
        "hub.command_line",
        "device",
        "player",
        "--connect",
        endpoint,
        "--session",
        "hand",
        *more,
    ]
    with file.open("w") as log, subprocess.Popen(command, stderr=log) as process:
        try:
            yield process
        finally:
            process.terminate()
            assert process.wait(LIMIT_S) == 0


def port(endpoint):
    return int(endpoint.rpartition(":")[2])


@pytest.mark.long
def test_a_host_outlives_the_hub_and_joins_the_next_session_of_its_name(prepare, tmp_path):
    first = Running(prepare(SCENARIO))
    until(lambda: first.status)
    with player(first.session.endpoint, tmp_path / "player.log") as process:
        until(lambda: first.is_followed())
        first.end()
        sleep(1.0)
        assert process.poll() is None
        second = Running(prepare(SCENARIO, endpoint=first.session.endpoint))
        until(lambda: second.is_followed())
        second.end()
    said = " ".join((tmp_path / "player.log").read_text().split())
    assert "device 'player': lost the hub; the device receives nothing until the hub returns" in said
    assert said.count("takes part in session 'hand'") == 2


def test_an_interrupt_that_was_lost_ends_the_host(prepare):
    """SIGTERM may arrive while Zenoh calls back in the main thread: it swallows what is raised there."""
    running = Running(prepare(SCENARIO))
    until(lambda: running.status)
    endpoint = running.session.endpoint
    request = JoinRequest(host="remote/player", pid=os.getpid())
    host = DeviceHost("player", lambda: reach(endpoint, "player"), Keys("hand"), request, None)

    def lost():
        if running.fresh:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        host.serve(lost)
    running.end()


@pytest.mark.long
def test_a_second_process_for_the_same_device_is_refused(prepare, tmp_path):
    running = Running(prepare(SCENARIO))
    until(lambda: running.status)
    with player(running.session.endpoint, tmp_path / "player.log") as process:
        until(lambda: running.is_followed())
        command = [
            sys.executable,
            "-P",
            "-m",
            "hub.command_line",
            "device",
            "player",
            "--connect",
            running.session.endpoint,
            "--session",
            "hand",
        ]
        second = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
        assert second.returncode == 1
        assert f"host 'remote/player' has joined already, as process {process.pid}: end that one" in " ".join(
            second.stderr.split()
        )
        until(running.is_followed)
        running.end()
    assert running.summary.dropped_messages == 1  # the request to join


@pytest.mark.long
def test_an_arm_holds_while_the_network_is_choked(prepare, tmp_path):
    forces = "loud.out -> player.noise"
    running = Running(prepare(SCENARIO))
    until(lambda: running.status)
    with (
        Proxy(port(running.session.endpoint)) as proxy,
        player(f"tcp/127.0.0.1:{proxy.port}", tmp_path / "player.log") as process,
    ):
        until(lambda: running.is_followed())
        proxy.hold()
        until(lambda: not running.is_followed())
        before, step = running.fresh, running.status.step
        until(lambda: running.status.step > step + 250)  # what is for the device waits for nobody
        assert running.fresh == before
        proxy.go_on()
        until(lambda: running.is_followed())
        assert running.status.participants[0].pid == process.pid
        until(lambda: any(one.count > 100 for one in running.status.latencies if one.stream == forces))
        process.terminate()
        process.wait(LIMIT_S)
        until(lambda: running.status.participants[0].pid == 0)
        running.end()
    # though the device is gone
    assert running.summary.latency["state to force"][forces]["count"] > 100
    assert (tmp_path / "player.log").read_text().count("takes part") == 1


@pytest.mark.long
def test_a_host_that_is_cut_off_joins_again(prepare, tmp_path, caplog):
    running = Running(prepare(SCENARIO))
    until(lambda: running.status)
    with (
        Proxy(port(running.session.endpoint)) as proxy,
        player(f"tcp/127.0.0.1:{proxy.port}", tmp_path / "player.log"),
    ):
        until(lambda: running.is_followed())
        proxy.cut()
        until(lambda: running.status.participants[0].pid == 0)
        until(lambda: not running.is_followed())
        sleep(1.0)
        proxy.go_on()
        until(lambda: running.is_followed())
        assert [device.device for device in until(lambda: running.status.devices)] == ["player"]
        running.end()
    assert (
        "device 'player' is gone, what it leads holds: start 'trocar device player' again, or mend the"
        " network" in caplog.text
    )
    assert (tmp_path / "player.log").read_text().count("takes part") == 2


@pytest.mark.long
def test_a_host_outlives_a_network_that_is_gone_for_long(prepare, tmp_path):
    """Packets are lost and no connection is closed, until both sides have given the other one up."""
    running = Running(prepare(SCENARIO))
    until(lambda: running.status)
    log = tmp_path / "player.log"
    with (
        Proxy(port(running.session.endpoint)) as proxy,
        player(f"tcp/127.0.0.1:{proxy.port}", log),
    ):
        until(lambda: running.is_followed())
        proxy.hold()
        until(lambda: "waits for the hub" in log.read_text())
        proxy.go_on()
        until(lambda: running.is_followed())
        running.end()
    assert log.read_text().count("takes part") == 2


@pytest.mark.long
def test_a_host_outlives_a_hub_that_is_killed(toys, tmp_path):
    (tmp_path / "session.yaml").write_text(SCENARIO)
    endpoint = free_endpoint()
    command = [
        sys.executable,
        "-P",
        "-m",
        "hub.command_line",
        "run",
        str(tmp_path / "session.yaml"),
        "--listen",
        endpoint,
    ]

    def is_followed():
        return any(
            one.stream == "player.hand" and one.count > 50
            for status in live_sessions([endpoint])
            for one in status.latencies
        )

    with ExitStack() as stack:
        for signal in (SIGKILL, SIGTERM):
            with subprocess.Popen(command, stderr=subprocess.DEVNULL) as hub:
                try:
                    until(lambda: live_sessions([endpoint]))
                    if signal == SIGKILL:
                        stack.enter_context(player(endpoint, tmp_path / "player.log"))
                    until(is_followed)
                finally:
                    hub.send_signal(signal)
    assert (tmp_path / "player.log").read_text().count("takes part") == 2
