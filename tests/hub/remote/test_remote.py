"""A session with participants on another machine: a network namespace of its own stands for it."""

import json
import os
import re
import secrets
import shutil
import socket
import subprocess
import sys
import threading
from contextlib import suppress
from time import sleep

import pytest

from hub.planning.scenario_file import load as load_scenario
from hub.remote.live_sessions import live_sessions
from hub.session.launch import launch
from hub.transport.endpoints import address
from tests.hub.authorities import Authority, free_port
from tests.waiting import until

# Programs on Cyclone DDS beside it take its interface for their own, and fall silent when that is removed.
pytestmark = pytest.mark.alone

SCENARIO = """\
name: hand
step: 10 ms
pace: realtime
duration: 60 s
participants:
  player: {kind: "toys:Player", clock: wall, max_age_ms: 100, host: remote}
  deaf: {kind: "toys:Deaf"}
  talker: {kind: "toys:Talker", host: far}
  pad: {kind: "toys:Pad", file: FILE, host: remote}
connections:
  - player.hand -> deaf.hand
  - player.buttons -> deaf.buttons
  - talker.words -> pad.words
measure:
  fresh_steps: {kind: final, of: deaf.fresh_steps, live: true}
  pressed: {kind: final, of: deaf.pressed, live: true}
"""
NETWORK = f"10.213.{os.getpid() % 250}"
"""Another one in each process: a run that was killed leaves its interface, with its addresses."""
HUB_ADDRESS, OTHER_ADDRESS = f"{NETWORK}.1", f"{NETWORK}.2"


def ip(*words):
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


@pytest.fixture(scope="module")
def other_machine():
    """Return the name of a network namespace that reaches this one at HUB_ADDRESS, and nothing else."""
    name = f"trocar-{secrets.token_hex(3)}"
    inside, outside = f"{name[7:]}-in", f"{name[7:]}-out"
    try:
        ip("netns", "add", name)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"network namespaces are not permitted here: {error}")
    try:
        ip("link", "add", outside, "type", "veth", "peer", "name", inside, "netns", name)
        ip("address", "add", f"{HUB_ADDRESS}/30", "dev", outside)
        ip("link", "set", outside, "up")
        ip("-n", name, "address", "add", f"{OTHER_ADDRESS}/30", "dev", inside)
        ip("-n", name, "link", "set", inside, "up")
        ip("-n", name, "link", "set", "lo", "up")
        yield name
    finally:
        ip("netns", "delete", name)


class Site:
    """A hub in this namespace, listening to the other one, and the processes that are started there."""

    def __init__(self, namespace, directory):
        self._namespace, self._directory = namespace, directory
        self.authority = Authority.founded(directory / "certs", HUB_ADDRESS)
        self.endpoint = f"tls/{HUB_ADDRESS}:{free_port()}"
        self.told = directory / "told.txt"
        file = directory / "session.yaml"
        file.write_text(SCENARIO.replace("FILE", str(self.told)))
        self.session = launch(
            load_scenario(str(file), ()),
            endpoint="tcp/127.0.0.1:0",
            outside=[self.endpoint],
            certificates=self.authority.directory,
        )

    def await_gate(self):
        """Wait until the hub listens to the other machine: a device host that comes earlier gives up."""
        _, port = address(self.endpoint)

        def listens():
            with suppress(OSError), socket.create_connection((HUB_ADDRESS, port)):
                return True
            return False

        until(listens)

    def cut(self):
        """Take the network between both machines away."""
        ip("-n", self._namespace, "link", "set", f"{self._namespace[7:]}-in", "down")

    def mend(self):
        """Bring it back."""
        ip("-n", self._namespace, "link", "set", f"{self._namespace[7:]}-in", "up")

    def start(self, *words, **options):
        """Start a Python process in the other namespace."""
        command = ["ip", "netns", "exec", self._namespace, sys.executable, "-P", *map(str, words)]
        return subprocess.Popen(
            command,
            cwd=self._directory,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            **options,
        )

    def device(self, name, certificates=None):
        """Start a device's host there, with nothing but its own certificate."""
        file = certificates or self.authority.issued(name).file
        carried = self._directory / f"{name}-machine" / f"{name}.pem"
        carried.parent.mkdir(exist_ok=True)
        shutil.copy(file, carried)
        return self.start(
            "-m", "hub.command_line", "device", name, "--connect", self.endpoint, "--certs", carried.parent
        )


@pytest.fixture
def site(toys, other_machine, tmp_path):
    return Site(other_machine, tmp_path)


def test_a_stylus_of_another_machine_moves_the_simulation_is_told_of_it_and_outlives_the_network(site):
    fresh_steps, outcome, hosts = [0.0], [], []

    def gains():
        before = fresh_steps[-1]
        sleep(0.3)
        return fresh_steps[-1] > before

    def told():
        return len(site.told.read_text().splitlines()) if site.told.exists() else 0

    def cut_and_mend():
        try:
            site.await_gate()
            hosts.extend([site.device("player"), site.device("pad")])
            until(lambda: gains() and told() > 20)
            site.cut()
            until(lambda: not gains())
            sleep(2.5)
            outcome.append(gains())
            before = told()
            site.mend()
            until(lambda: gains() and told() > before)
        except TimeoutError as error:
            outcome.append(error)
        finally:
            site.session.state.shutdown()

    console = threading.Thread(target=cut_and_mend)
    console.start()
    summary = site.session.run(
        lambda progress: fresh_steps.append(progress.live.get("fresh_steps", (0.0, ""))[0])
    )
    console.join()
    for host in hosts:
        host.terminate()
    said = [host.communicate()[0] for host in hosts]
    assert outcome == [False], said  # it held while there was no network, and went on
    assert summary.state == "done"
    assert summary.measures["pressed"] > 20
    assert site.told.read_text().startswith("words word ")
    assert "takes part in session 'hand'" in said[0]


STRANGER = """
import json, sys
from pathlib import Path
from hub.security.credentials import load
from hub.transport.zenoh_session import open_session
from schemas.errors import ConnectError
endpoint, file, bare, keys, asked = json.loads(sys.argv[1])
security = load("", Path(file)).connecting() | {"connect/timeout_ms": 4000}
if bare:
    security = {key: value for key, value in security.items() if "/connect_" not in key}
    security["transport/link/tls/enable_mtls"] = False
try:
    with open_session("client", connect=[endpoint], security=security) as session:
        heard = []
        session.declare_subscriber("**", lambda sample: heard.append(str(sample.key_expr)))
        for key in keys:
            session.put(key, b"x", attachment=bytes(24))
        replies = [reply for key in asked for reply in session.get(key, timeout=1.0)]
        answers = [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
        print(json.dumps({"heard": sorted({*heard} - {*keys}), "answers": answers}))
except ConnectError:
    print(json.dumps("no connection"))
"""


def test_strangers_of_another_machine_get_nothing_in_or_out_and_the_log_tells(site, tmp_path, caplog):
    caplog.set_level("INFO")
    own, foreign, mixed = (
        site.authority.issued("pad"),
        Authority.founded(tmp_path / "foreign").issued("player"),
        tmp_path / "mixed.pem",
    )
    mixed.write_text(foreign.key + foreign.certificate + own.authority)
    keys = ["trocar/hand/device/player/out/hand", "trocar/hand/engine/deaf/ack", "trocar/hand/hub/grant"]
    asked = ["trocar/hand/control/shutdown", "trocar/*/control/join/remote/player", "trocar/hand/hub/status"]
    ways = {
        "without a certificate": (site.endpoint, own.file, True),
        "with a certificate of another authority": (site.endpoint, mixed, False),
        "with the certificate of another device": (site.endpoint, own.file, False),
        "by plain TCP": (site.endpoint.replace("tls/", "tcp/"), own.file, True),
    }
    found = {}

    def try_all():
        try:
            site.await_gate()
            hosts = [site.device("player"), site.device("pad")]
            until(lambda: any(s.step > 50 for s in live_sessions([site.session.endpoint])))
            for way, (endpoint, file, bare) in ways.items():
                done = site.start(
                    "-c", STRANGER, json.dumps([endpoint, str(file), bare, keys, asked])
                ).communicate(timeout=120)[0]
                found[way] = json.loads(done.splitlines()[-1])
            for host in hosts:
                host.terminate()
                host.communicate()
        finally:
            site.session.state.shutdown()

    strangers = threading.Thread(target=try_all)
    strangers.start()
    summary = site.session.run()
    strangers.join()
    nothing = {"heard": [], "answers": []}
    assert found == dict.fromkeys(ways, "no connection") | {"with the certificate of another device": nothing}
    assert summary.state == "done"
    assert summary.dropped_messages == 0
    log = "\n".join(caplog.messages)
    for words in (
        "it shows no certificate",
        "its certificate is of another authority",
        "it does not speak TLS",
    ):
        assert f"gate: refused a connection: {words}" in log
    assert re.search(rf"gate: the connection from {OTHER_ADDRESS}:\d+ was not accepted", log)
    for key in keys:
        assert re.search(rf"gate: refused to 'pad' at {OTHER_ADDRESS}:\d+: to put on {key}", log)
