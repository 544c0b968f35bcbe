"""Loopback is open to every user of a machine: a session hears only those that have its secret."""

import os
import socket
import stat
import subprocess
import sys
import threading
from contextlib import contextmanager
from pathlib import Path

import pytest

from hub.remote.hub_connection import reach
from hub.remote.live_sessions import live_sessions
from hub.session.ack_receiver import AckReceiver
from hub.transport.control_client import ask
from hub.transport.control_messages import Empty, SetRequest
from hub.transport.endpoints import address
from hub.transport.envelope import signature
from hub.transport.host_link import HostLink, HubLink, has_link
from hub.transport.loopback_port import LoopbackPort
from hub.transport.refusals import Refusals
from hub.transport.run_connection import RunConnection
from hub.transport.session_secret import listen_with_secret, private_directory, secret_of
from hub.transport.zenoh_session import open_session
from schemas.codec import encode
from schemas.errors import ConnectError, MessageError, ParticipantError
from schemas.keys import Keys
from schemas.lockstep import Ack, Grant, pack_ack
from schemas.ros import StringMessage
from tests.hub.authorities import free_endpoint
from tests.hub.processes import hosts
from tests.waiting import LIMIT_S, until

SCENARIO = """\
name: guarded
step: 1 ms
duration: 300 ms
participants:
  here: {kind: "toys:Mixer"}
  there: {kind: "toys:Mixer", host: other}
connections:
  - here.out -> there.a
"""
KEYS = Keys("guarded")
HOSTS = bytes(16)
"""The key with which hosts sign."""
IMPATIENT = {"connect/timeout_ms": 400}
WRONG = {"transport/auth/usrpwd/user": "trocar", "transport/auth/usrpwd/password": "0" * 64}


@contextmanager
def running(session):
    """Run a session in a thread, from its first half on paused; yield its outcome, complete at the end."""
    outcome = []

    def run():
        try:
            outcome.append(session.run())
        except ParticipantError as error:
            outcome.append(error)

    session.state.step(150)
    thread = threading.Thread(target=run)
    thread.start()
    try:
        until(lambda: outcome or any(s.state == "paused" for s in live_sessions([session.endpoint])))
        yield outcome
    finally:
        session.state.resume()
        thread.join()


def listening(pid):
    """Return the endpoints on loopback at which a process listens."""
    mine = {str(entry.readlink()) for entry in Path(f"/proc/{pid}/fd").iterdir() if entry.is_symlink()}
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return [
        f"tcp/127.0.0.1:{int(row[1].partition(':')[2], 16)}"
        for row in rows
        if row[3] == "0A" and f"socket:[{row[9]}]" in mine
    ]


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="finds the ports of a process in /proc")
def test_without_the_secret_neither_the_hub_nor_a_host_lets_anybody_in(prepare):
    expected = prepare(SCENARIO).run()
    session = prepare(SCENARIO)
    with running(session) as outcome:
        (host,) = hosts(session.endpoint)
        inside = listening(host)
        assert inside
        for endpoint in (session.endpoint, *inside):
            for mode, secret in (("client", {}), ("peer", {}), ("router", WRONG)):
                own = [] if mode == "client" else ["tcp/127.0.0.1:0"]
                with pytest.raises(ConnectError):
                    open_session(mode, listen=own, connect=[endpoint], security=IMPATIENT | secret)
    (summary,) = outcome
    assert (summary.state, summary.state_hash) == ("done", expected.state_hash)
    assert summary.dropped_messages == 0


def test_the_secret_lies_in_a_file_of_this_user_as_long_as_the_hub_runs():
    port = LoopbackPort("tcp/127.0.0.1:0")
    with listen_with_secret(port):
        file = private_directory() / str(address(port.endpoint)[1])
        first = file.read_text()
        if os.name == "posix":
            assert stat.S_IMODE(file.stat().st_mode) == 0o600
            assert stat.S_IMODE(file.parent.stat().st_mode) == 0o700
        with open_session("client", connect=[port.endpoint], security=secret_of(port.endpoint)) as session:
            assert list(session.info.routers_zid())
    assert not file.exists()
    with listen_with_secret(LoopbackPort(port.endpoint)):
        assert file.read_text() != first


def test_a_hub_that_finds_its_port_taken_leaves_the_secret_of_the_other_one(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))  # other sessions write beside the user's secrets
    port = LoopbackPort("tcp/127.0.0.1:0")
    with listen_with_secret(port):
        before, files = secret_of(port.endpoint), set(private_directory().iterdir())
        with (
            pytest.raises(ConnectError, match="cannot listen on"),
            listen_with_secret(LoopbackPort(port.endpoint)),
        ):
            pass
        assert secret_of(port.endpoint) == before
        assert files <= set(private_directory().iterdir())


@pytest.mark.skipif(os.name != "posix", reason="rights of files")
def test_a_directory_that_is_open_to_others_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    private_directory().chmod(0o755)
    with pytest.raises(ConnectError, match="must be a directory of this user with mode 0700"):
        private_directory()


def test_what_listens_without_a_session_of_this_user_is_named():
    with socket.create_server(("127.0.0.1", 0)) as server:
        endpoint = f"tcp/127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(ConnectError, match=f"no session of this user listens at {endpoint}"):
            reach(endpoint, "console")


@pytest.mark.long
def test_a_host_that_the_same_user_starts_by_hand_joins(prepare):
    session = prepare(SCENARIO, "participants.there.host=remote", "join_limit=60 s")
    command = [
        sys.executable,
        "-P",
        "-m",
        "hub.command_line",
        "engine",
        "there",
        "--connect",
        session.endpoint,
    ]
    with running_later(command) as process:
        assert session.run().state == "done"
        assert process().wait(LIMIT_S) == 0


@pytest.mark.long
def test_a_host_with_a_link_and_one_that_joins_by_hand_step_together(prepare):
    text = SCENARIO.replace("connections:", '  far: {kind: "toys:Mixer", host: remote}\nconnections:')
    text += "  - there.out -> far.a\n  - far.out -> there.b\norder: [here, there, far]\n"
    expected = prepare(text, *(f"participants.{name}.host=hub" for name in ("there", "far"))).run()
    session = prepare(text, "join_limit=60 s")
    command = [sys.executable, "-P", "-m", "hub.command_line", "engine", "far", "--connect", session.endpoint]
    with running_later(command) as process:
        summary = session.run()
        assert process().wait(LIMIT_S) == 0
    assert (summary.state_hash, summary.dropped_messages) == (expected.state_hash, 0)


@contextmanager
def running_later(command):
    """Start a command as a person would who has waited for the hub to listen."""
    started = []

    def start():
        endpoint = command[-1]
        until(lambda: (private_directory() / str(address(endpoint)[1])).exists())
        started.append(subprocess.Popen(command, stderr=subprocess.DEVNULL))

    thread = threading.Thread(target=start)
    thread.start()
    yield lambda: started[0]
    thread.join()


def forged(run, step, key=b"another host's"):
    payload = pack_ack(Ack(run, 0, step, (7,), (0,), ()))
    return payload, signature(payload, key)


def test_a_forged_ack_ends_the_session_with_the_reason(prepare):
    session = prepare(SCENARIO)
    with running(session) as outcome, reach(session.endpoint, "bad") as bad:
        runs = live_sessions([session.endpoint])[0].run
        payload, attachment = forged(runs, 150)
        bad.put(KEYS.ack("there"), payload, attachment=attachment)
        session.state.step(1)
        until(lambda: outcome)
    (error,) = outcome
    assert isinstance(error, ParticipantError)
    assert error.participant == "there"
    assert "an ack of it has arrived that its host 'other' did not send" in str(error)


@pytest.fixture(params=["zenoh", "link"])
def acks(prepare, request):
    """The receiver of a run, without the run: what its host sends arrives, over Zenoh or by its link."""
    plan = prepare(SCENARIO).plan
    if request.param == "link" and not has_link("other"):
        pytest.skip("hosts have links on Linux alone")
    with open_session("router", listen=[free_endpoint()]) as session:
        refusals = Refusals()
        links = {"other": HubLink(["there"])} if request.param == "link" else {}
        keys = dict.fromkeys(plan.hosts(), HOSTS)
        receiver = AckReceiver(RunConnection(session, KEYS, plan, 5, refusals), keys, links)
        host = HostLink(*map(os.dup, links["other"].inherited)) if links else None

        def publish(hash_, step=3):
            payload = pack_ack(Ack(5, 0, step, (hash_,), (0,), ()))
            if host is not None:
                host.send_acks([(0, payload)])
            else:
                session.put(KEYS.ack("there"), payload, attachment=signature(payload, HOSTS))

        yield publish, receiver, refusals
        for end in (*links.values(), *([host] if host else [])):
            end.close()


def accepted(receiver, step=3):
    found = receiver.receive(["there"], Grant(5, 0, step, 0, 1), {"there": 1})
    return [list(ack.state_hash) for _, ack, _ in found]


def test_a_second_ack_of_a_step_ends_the_session(acks):
    publish, receiver, _ = acks
    publish(1)
    publish(2)
    assert accepted(receiver) == [[1]]
    with pytest.raises(ParticipantError, match="'there' failed at step 3: a second ack of it has arrived"):
        accepted(receiver, step=4)


def test_a_second_ack_of_the_last_step_ends_the_session(acks):
    publish, receiver, _ = acks
    publish(1)
    assert accepted(receiver) == [[1]]
    publish(2)
    with pytest.raises(ParticipantError):
        receiver.end(4)


def test_an_ack_that_is_only_repeated_is_refused_and_counted(acks):
    publish, receiver, refusals = acks
    publish(1)
    publish(1)
    publish(2, step=4)
    assert (accepted(receiver), accepted(receiver, 4), accepted(receiver, 4)) == ([[1]], [], [[2]])
    assert refusals.total == 1


@pytest.mark.long
def test_control_messages_that_are_nested_long_or_many_are_refused_unread(prepare, caplog):
    nested = SetRequest(participant="there", port="b", value=0).model_dump_json()
    nested = nested.replace('"value":0', '"value":' + "[" * 180 + "]" * 180)
    session = prepare(SCENARIO)
    with running(session) as outcome, reach(session.endpoint, "bad") as bad:
        for text, words in ((nested, "nested more than 16 deep"), (" " * 2**19, "at most 262144")):
            (reply,) = bad.get(KEYS.control("set"), payload=encode(StringMessage(data=text)), timeout=60.0)
            assert words in reply.ok.payload.to_bytes().decode(errors="replace")
        # brackets in a text are no nesting
        with pytest.raises(MessageError, match="cannot be set"):
            ask(bad, KEYS.control("set"), SetRequest(participant="[" * 100, port='"[', value=0), Empty)
        refused = sum(
            b"more than 100 requests/s" in reply.ok.payload.to_bytes()
            for _ in range(300)
            for reply in bad.get(KEYS.control("resume"), payload=b"x", timeout=60.0)
        )
        assert refused
        assert ask(bad, KEYS.control("pause"), Empty(), Empty) == Empty()
    assert outcome[0].state == "done"
    assert len([line for line in caplog.messages if "dropped a message" in line]) <= 8
