"""Who comes to the gate of a hub, what they are let do there, and what is told of those that are refused."""

import json
import logging
import os
import signal
import socket
import ssl
import subprocess
import sys
from contextlib import contextmanager, suppress
from time import sleep

import pytest
import zenoh
from zenoh.handlers import Callback

from hub.planning.plan import (
    ConnectionFromDevice,
    ConnectionToDevice,
    Plan,
    PlannedConnection,
    PlannedParticipant,
)
from hub.security import certs, revoked
from hub.security.access import access_settings
from hub.security.credentials import Credentials
from hub.security.gate import Gate
from hub.transport.zenoh_session import open_session
from schemas.errors import ConnectError
from schemas.keys import Keys
from schemas.ports import Port
from tests.hub.authorities import Authority, free_endpoint, free_port
from tests.waiting import until

KEYS = Keys("s")
PLAN = Plan(
    step_ns=1_000_000,
    order=("robot", "far"),
    participants={
        "touch": PlannedParticipant(
            name="touch",
            kind="touch",
            role="device",
            host="remote/touch",
            period=1,
            ports=(Port(name="pose", causality="output"), Port(name="contact", causality="input")),
        ),
        "head": PlannedParticipant(
            name="head",
            kind="openxr",
            role="device",
            host="remote/head",
            period=1,
            ports=(Port(name="pose", causality="output"),),
        ),
        "robot": PlannedParticipant(
            name="robot",
            kind="mujoco",
            role="engine",
            host="robot",
            period=1,
            ports=(
                Port(name="goal", causality="input"),
                Port(name="contact", causality="output"),
                Port(name="secret", causality="output"),
            ),
        ),
        "far": PlannedParticipant(
            name="far",
            kind="fmu",
            role="engine",
            host="remote/far",
            period=1,
            ports=(Port(name="in", causality="input"),),
        ),
    },
    connections=(
        PlannedConnection(
            source="robot", source_port="contact", target="far", target_port="in", fresh=True, linear=False
        ),
    ),
    from_devices=(
        ConnectionFromDevice(
            source="touch", source_port="pose", target="robot", target_port="goal", max_age_ns=0
        ),
    ),
    to_devices=(
        ConnectionToDevice(source="robot", source_port="contact", target="touch", target_port="contact"),
    ),
    bonds=(),
)
CONTACT, SECRET = (KEYS.output("engine", "robot", port) for port in ("contact", "secret"))
FEED, OTHERS_FEED = (KEYS.signals("robot", device) for device in ("touch", "head"))


class Hub:
    """A hub's router with its gate, which listens to all of its session, says something on every key, and
    answers everybody.
    """

    def __init__(self, directory):
        self.authority = Authority.founded(directory / "own")
        self.stranger = Authority.founded(directory / "strange")
        self.port, inside = free_port(), free_endpoint()
        self.endpoint = f"tls/127.0.0.1:{self.port}"
        self.heard: list[str] = []
        self.router = open_session("router", listen=[inside])
        self.revoked = self.authority.directory / revoked.FILE
        self.gate = Gate(
            [self.endpoint], self.authority.hub.listening() | access_settings(PLAN, "s"), self.revoked
        )
        self.router.declare_subscriber(
            "**", Callback(lambda sample: self.heard.append(str(sample.key_expr)), indirect=False)
        )
        self.router.liveliness().declare_subscriber(
            "**", Callback(lambda sample: self.heard.append(f"alive: {sample.key_expr}"), indirect=False)
        )
        self.router.declare_queryable(f"{KEYS.prefix}/**", Callback(self._answer))
        self.token = self.router.liveliness().declare_token(KEYS.alive("hub", "hub"))
        self.gate.open(inside)

    def _answer(self, query):
        with query:
            self.heard.append(f"asked: {query.key_expr}")
            query.reply(str(query.key_expr).replace("/*/", "/s/", 1), b"a secret")

    def say(self):
        for key in (
            CONTACT,
            FEED,
            OTHERS_FEED,
            SECRET,
            KEYS.grant,
            KEYS.status,
            KEYS.link("touch"),
            KEYS.link("head"),
            KEYS.output("device", "head", "pose"),
        ):
            self.router.put(key, b"said")

    @contextmanager
    def client(self, credentials, protocol="tls", mode="client"):
        """Connect; raises ConnectError after a moment."""
        settings = {} if credentials is None else credentials.connecting()
        with open_session(
            mode,
            connect=[f"{protocol}/127.0.0.1:{self.port}"],
            security=settings | {"connect/timeout_ms": 300},
        ) as session:
            yield session

    def close(self):
        self.gate.close()
        self.router.close()


@pytest.fixture(scope="module")
def hub(tmp_path_factory):
    hub = Hub(tmp_path_factory.mktemp("hub"))
    yield hub
    hub.close()


@pytest.fixture
def told(caplog):
    """Return a function that waits for a line of the gate's in the hub's log."""
    caplog.set_level(logging.INFO)

    def wait(*words):
        until(lambda: any(all(word in line for word in words) for line in caplog.messages))

    return wait


def hears(session, key):
    """Return the list to which the keys are added that come to a subscriber of `key`."""
    heard = []
    session.declare_subscriber(
        key,
        Callback(lambda sample: heard.append(str(sample.key_expr)), indirect=False),
        allowed_origin=zenoh.Locality.REMOTE,
    )
    return heard


def asks(session, key):
    return [str(reply.ok.key_expr) for reply in session.get(key, timeout=1.0) if reply.ok is not None]


def test_a_device_does_its_part(hub, told, caplog):
    with hub.client(hub.authority.issued("touch")) as touch:
        told("'touch' connects from 127.0.0.1:")
        until(lambda: asks(touch, Keys("*").join("remote/touch")) == [KEYS.join("remote/touch")])
        until(lambda: asks(touch, KEYS.control("clock")) == [KEYS.control("clock")])
        contact, link, alive = hears(touch, FEED), hears(touch, KEYS.link("touch")), []
        touch.liveliness().declare_subscriber(
            KEYS.alive("hub", "hub"), Callback(lambda sample: alive.append(sample.kind)), history=True
        )
        touch.liveliness().declare_token(KEYS.alive("device", "touch"))
        for key in (
            KEYS.output("device", "touch", "pose"),
            KEYS.device_status("touch"),
            KEYS.dropped_messages("device", "touch"),
        ):
            touch.put(key, b"x")
            until(lambda key=key: key in hub.heard)
        until(lambda: hub.say() or (contact and link and alive))  # again, until it has subscribed
        until(lambda: f"alive: {KEYS.alive('device', 'touch')}" in hub.heard)
    sleep(0.5)
    assert not [line for line in caplog.messages if "refused" in line or "not accepted" in line]


def test_a_remote_engine_hears_grants_too(hub):
    with hub.client(hub.authority.issued("far")) as far:
        grants, contact = hears(far, KEYS.grant), hears(far, CONTACT)
        far.put(KEYS.ack("far"), b"x")
        until(lambda: KEYS.ack("far") in hub.heard)
        until(lambda: hub.say() or (grants and contact))


def test_an_observer_reads_the_status_and_nothing_else(hub, told):
    with hub.client(hub.authority.issued("observer")) as observer:
        until(lambda: asks(observer, Keys("*").status) == [KEYS.status])
        status, other = hears(observer, KEYS.status), hears(observer, "**")
        assert asks(observer, KEYS.control("shutdown")) == []
        until(lambda: hub.say() or status)
        assert set(other) == {KEYS.status}
        told("refused to 'observer'", "query on trocar/s/control/shutdown")


FORBIDDEN = {
    "the output of another device": lambda session: session.put(KEYS.output("device", "head", "pose"), b"x"),
    "the output of another device, declared first": (
        lambda session: session.declare_publisher(KEYS.output("device", "head", "pose")).put(b"x")
    ),
    "the output of an engine": lambda session: session.put(SECRET, b"x"),
    "the report of an engine": lambda session: session.put(KEYS.ack("robot"), b"x"),
    "a grant": lambda session: session.put(KEYS.grant, b"x"),
    "the life of another device": (
        lambda session: session.liveliness().declare_token(KEYS.alive("device", "head"))
    ),
    "another session": lambda session: session.put(Keys("t").output("device", "touch", "pose"), b"x"),
    "an answer": lambda session: session.declare_queryable(
        KEYS.control("pause"), Callback(lambda query: query.drop())
    ),
}
ASKED = [
    KEYS.control("shutdown"),
    KEYS.control("pause"),
    KEYS.join("remote/head"),
    KEYS.join("robot"),
    KEYS.control("**"),
    KEYS.status,
    "trocar/**",
    "@/*/router/**",
]
READ = [
    OTHERS_FEED,
    CONTACT,
    SECRET,
    KEYS.grant,
    KEYS.status,
    KEYS.link("head"),
    KEYS.output("device", "head", "pose"),
    "trocar/**",
    "**",
]


@pytest.mark.parametrize("deed", FORBIDDEN)
def test_a_device_says_nothing_in_the_place_of_others(hub, told, deed):
    with hub.client(hub.authority.issued("touch")) as touch:
        hub.heard.clear()
        kept = FORBIDDEN[deed](touch)
        told("refused to 'touch' at 127.0.0.1:")
        # what comes after it is heard, so what came before it was not
        touch.put(KEYS.output("device", "touch", "pose"), b"x")
        until(lambda: KEYS.output("device", "touch", "pose") in hub.heard)
        assert set(hub.heard) == {KEYS.output("device", "touch", "pose")}
        del kept


@pytest.mark.parametrize("key", ASKED)
def test_a_device_asks_nothing_that_is_not_for_it(hub, told, key):
    with hub.client(hub.authority.issued("touch")) as touch:
        hub.heard.clear()
        assert asks(touch, key) == []
        assert hub.heard == []
        told("refused to 'touch' at 127.0.0.1:", f"query on {key}")


@pytest.mark.parametrize("key", READ)
def test_a_device_hears_nothing_that_is_not_for_it(hub, told, key):
    with hub.client(hub.authority.issued("touch")) as touch:
        own, heard = hears(touch, FEED), hears(touch, key)
        told("refused to 'touch' at 127.0.0.1:", f" on {key}")
        until(lambda: hub.say() or own)
        assert set(heard) <= {FEED, KEYS.link("touch")}  # what the session is sent for its other subscribers


@pytest.mark.parametrize("mode", ["peer", "router"])
def test_who_does_not_come_as_a_client_may_do_no_more(hub, told, mode):
    with hub.client(hub.authority.issued("touch"), mode=mode) as touch:
        heard, alive = hears(touch, "**"), []
        touch.liveliness().declare_subscriber(
            "**", Callback(lambda sample: alive.append(str(sample.key_expr))), history=True
        )
        told("refused to 'touch' at 127.0.0.1:", "declare subscriber on **")
        hub.say()
        hub.heard.clear()
        for key in (
            SECRET,
            KEYS.grant,
            KEYS.output("device", "head", "pose"),
            KEYS.output("device", "touch", "pose"),
        ):
            touch.put(key, b"x")
        touch.liveliness().declare_token(KEYS.alive("device", "head"))
        assert asks(touch, KEYS.control("shutdown")) == []
        sleep(0.3)
        assert heard == []
        # what it may see, and what it said itself
        assert set(alive) <= {KEYS.alive("hub", "hub"), KEYS.alive("device", "head")}
        assert set(hub.heard) <= {KEYS.output("device", "touch", "pose")}


def test_a_participant_that_the_session_has_not_gets_nothing(hub, told):
    with hub.client(hub.authority.issued("nobody")) as nobody:
        told("'nobody' connects from 127.0.0.1:", "no remote participant of this session has that name")
        hub.heard.clear()
        heard = hears(nobody, "**")
        nobody.put(KEYS.output("device", "nobody", "pose"), b"x")
        assert asks(nobody, "trocar/**") == []
        hub.say()
        sleep(0.1)
        assert heard == []
        assert not [key for key in hub.heard if "nobody" in key or "asked" in key]


def test_a_message_that_is_too_long_is_not_passed_on(hub):
    with hub.client(hub.authority.issued("touch")) as touch:
        hub.heard.clear()
        touch.put(KEYS.output("device", "touch", "pose"), bytes(2**20 + 1))
        touch.put(KEYS.device_status("touch"), b"x")
        until(lambda: hub.heard)
        assert hub.heard == [KEYS.device_status("touch")]


def test_a_certificate_of_another_authority_opens_nothing(hub, told):
    own, foreign = hub.authority.issued("touch"), hub.stranger.issued("touch")
    mixed = Credentials(own.file, foreign.key, foreign.certificate, own.authority)
    with pytest.raises(ConnectError), hub.client(mixed):
        pass
    told("refused a connection: its certificate is of another authority")


def test_a_hub_of_another_authority_is_not_talked_to(hub, told):
    with pytest.raises(ConnectError), hub.client(hub.stranger.issued("touch")):
        pass
    told("refused a connection: it does not know the authority of the hub's certificate")


def test_an_expired_certificate_opens_nothing(hub, told):
    with pytest.raises(ConnectError), hub.client(hub.authority.issued("touch", days=-0.01)):
        pass
    told("refused a connection: its certificate has expired")


def test_the_hubs_own_certificate_is_none_of_a_participant(hub, told):
    with pytest.raises(ConnectError), hub.client(hub.authority.hub):
        pass
    told("refused a connection: its certificate is not that of a participant")


def test_plain_tcp_opens_nothing(hub, told):
    with pytest.raises(ConnectError), hub.client(None, protocol="tcp"):
        pass
    told("refused a connection: it does not speak TLS")
    if sys.platform == "linux":
        told("the connection from 127.0.0.1:", "was not accepted")


def test_nobody_without_a_certificate_gets_in(hub, told):
    context = ssl.create_default_context(cadata=hub.authority.hub.authority)
    plain = socket.create_connection(("127.0.0.1", hub.port))
    with (
        context.wrap_socket(plain, server_hostname="127.0.0.1") as secure,
        pytest.raises(ssl.SSLError, match="CERTIFICATE_REQUIRED"),
    ):
        secure.recv(1)
    told("refused a connection: it shows no certificate")


def test_connections_that_say_nothing_cost_those_who_are_in_nothing_and_others_a_while(tmp_path):
    hub = Hub(tmp_path)
    pose = KEYS.output("device", "touch", "pose")
    try:
        with hub.client(hub.authority.issued("touch")) as touch:
            silent = [socket.create_connection(("127.0.0.1", hub.port)) for _ in range(50)]
            for one in silent:
                one.sendall(b"\x16\x03\x01")  # the beginning of a hello
            hub.heard.clear()
            until(lambda: touch.put(pose, b"x") or pose in hub.heard)
            assert _opens(hub)
            for one in silent:
                one.close()
            hub.heard.clear()
            until(lambda: touch.put(pose, b"x") or pose in hub.heard)
        # Zenoh waits 0.1 s for each of them
        until(lambda: _opens(hub), limit_s=60)
        assert hub.gate._process.poll() is None
    finally:
        hub.close()


def test_a_connection_ends_when_its_certificate_does(hub):
    short = hub.authority.issued("touch", days=2.0 / 86400)
    with hub.client(short) as touch:
        touch.put(KEYS.output("device", "touch", "pose"), b"x")
        until(lambda: not list(touch.info.routers_zid()))


def test_a_gate_that_is_killed_opens_again(tmp_path, told):
    hub = Hub(tmp_path)
    try:
        os.kill(hub.gate._process.pid, signal.SIGKILL)
        told("the gate ended with exit code -9; restarting it")
        until(lambda: _opens(hub))
    finally:
        hub.close()


def _opens(hub):
    try:
        with hub.client(hub.authority.issued("touch")):
            return True
    except ConnectError:
        return False


@pytest.mark.parametrize("listens", [False, True])
def test_a_gate_whose_hub_is_killed_ends_without_a_traceback(tmp_path, listens):
    """A connection that it would report closes meanwhile."""
    port, inside = free_port(), free_endpoint()
    security = Authority.founded(tmp_path).hub.listening() | access_settings(PLAN, "s")
    orders = {"listen": [f"tls/127.0.0.1:{port}"], "connect": [inside], "security": security, "revoked": None}
    with (
        open_session("router", listen=[inside]),
        subprocess.Popen(
            [sys.executable, "-P", "-m", "hub.security.gate_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        ) as gate,
    ):
        if listens:
            gate.stdin.write(json.dumps(orders).encode() + b"\n")
            gate.stdin.flush()
            assert gate.stdout.readline() == b"open\n"
        gate.stdout.close()
        if listens:
            for _ in range(3):
                with socket.create_connection(("127.0.0.1", port)) as stranger, suppress(OSError):
                    stranger.sendall(b"GET / HTTP/1.1\r\n\r\n")
                    while stranger.recv(1000):
                        pass
            sleep(0.5)
        gate.stdin.close()
        assert gate.stderr.read() == b""
        gate.wait(120)


def test_a_revoked_certificate_loses_its_connection_and_its_rights(tmp_path, told):
    hub = Hub(tmp_path)
    pose, others = (KEYS.output("device", name, "pose") for name in ("touch", "head"))
    try:
        stolen = hub.authority.issued("touch")
        with hub.client(stolen) as thief, hub.client(hub.authority.issued("head")) as head:
            thief.put(pose, b"x")
            until(lambda: pose in hub.heard)
            certs.revoke(hub.authority.directory, "touch")
            told("the list of revoked certificates has changed")
            told("'touch' connects from 127.0.0.1:", "with a revoked certificate: it has no rights")
            hub.heard.clear()
            thief.put(pose, b"x")
            until(lambda: head.put(others, b"x") or others in hub.heard)
            assert pose not in hub.heard
            assert asks(thief, Keys("*").join("remote/touch")) == []
            with hub.client(hub.authority.issued("touch")) as touch:
                told("'touch.2' connects from 127.0.0.1:")
                touch.put(pose, b"x")
                until(lambda: pose in hub.heard)
                until(lambda: asks(touch, Keys("*").join("remote/touch")) == [KEYS.join("remote/touch")])
    finally:
        hub.close()


def test_a_gate_whose_list_cannot_be_read_stays_closed_until_it_can(tmp_path, told):
    hub = Hub(tmp_path)
    try:
        hub.revoked.write_text("touch, lost on Monday\n")
        told("revoked.txt:1: 'touch, lost on Monday' is no name of a certificate")
        assert not _opens(hub)
        hub.revoked.write_text("observer\n")
        until(lambda: _opens(hub))
    finally:
        hub.close()


def test_a_gate_that_cannot_listen_says_so(tmp_path):
    authority, inside = Authority.founded(tmp_path), free_endpoint()
    with socket.create_server(("127.0.0.1", 0)) as taken, open_session("router", listen=[inside]):
        gate = Gate(
            [f"tls/127.0.0.1:{taken.getsockname()[1]}"],
            authority.hub.listening() | access_settings(PLAN, "s"),
        )
        with pytest.raises(ConnectError, match=r"cannot listen on tls/127\.0\.0\.1"):
            gate.open(inside)
        gate.close()
