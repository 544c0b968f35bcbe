"""An engine on the other side of a gate computes what it would compute here."""

import subprocess
import sys
from threading import Thread
from time import sleep

import pytest

from hub.planning.scenario_file import load
from hub.planning.session_parameters import SessionParameters
from hub.security.access import access_settings
from hub.session.joined_hosts import JoinedHosts
from hub.session.launch import launch, plan_of
from hub.transport.control_messages import JoinRequest
from schemas.errors import ConnectError, MessageError
from schemas.files import Files
from tests.hub.authorities import Authority, free_port

SCENARIO = """\
name: apart
step: 1 ms
duration: 100 ms
participants:
  near: {kind: "toys:Mixer"}
  far: {kind: "toys:Mixer", out_every: 2}
  hand: {kind: "toys:Player", clock: wall, host: remote}
  deaf: {kind: "toys:Deaf", host: other}
order: [near, far, deaf]
connections:
  - near.out -> far.a
  - far.out -> near.b
  - hand.hand -> deaf.hand
"""


@pytest.fixture
def loaded(toys, tmp_path):
    file = tmp_path / "session.yaml"

    def load_it(*overrides, text=SCENARIO):
        file.write_text(text)
        return load(str(file), overrides)

    return load_it


ALONE = (
    "\n".join(line for line in SCENARIO.splitlines() if "hand" not in line and "deaf" not in line)
    + "\norder: [near, far]\n"
)


@pytest.mark.long
def test_its_hashes_are_the_same(loaded, tmp_path):
    expected = launch(loaded(text=ALONE), endpoint="tcp/127.0.0.1:0").run()
    authority, endpoint = Authority.founded(tmp_path / "certs"), f"tls/127.0.0.1:{free_port()}"
    session = launch(
        loaded("participants.far.host=remote", text=ALONE),
        endpoint="tcp/127.0.0.1:0",
        outside=[endpoint],
        certificates=authority.directory,
    )
    command = [
        sys.executable,
        "-P",
        "-m",
        "hub.command_line",
        "engine",
        "far",
        "--connect",
        endpoint,
        "--certs",
        authority.issued("far").file,
    ]
    starter = _Starter(session, command)
    summary = session.run()
    assert starter.process.wait(120) == 0
    assert summary.state_hash == expected.state_hash
    assert summary.dropped_messages == 0


class _Starter:
    """Starts a process as soon as the gate of a session is open."""

    def __init__(self, session, command):
        gate = session.gate
        opening = gate.open

        def open_and_start(hub):
            opening(hub)
            self.process = subprocess.Popen(command, stderr=subprocess.DEVNULL)

        gate.open = open_and_start


def test_a_host_elsewhere_is_told_what_concerns_it(loaded):
    file = loaded()
    plan, _ = plan_of(file.scenario, file.params)
    seen = plan.seen_from("remote/hand")
    assert set(seen.participants) == {"hand", "deaf"}
    assert [port.name for port in seen.participants["deaf"].ports] == ["hand"]
    assert (seen.connections, len(seen.from_devices)) == ((), 1)
    joined_hosts = JoinedHosts(
        file.scenario.name,
        plan,
        SessionParameters.of_scenario(file.scenario, Files(file.source.directory)),
        1,
        [("near", "out"), ("hand", "hand")],
        lambda *_: None,
        lambda *_: None,
        ack_keys=dict.fromkeys(plan.hosts(), b"key"),
    )
    reply = joined_hosts.join(JoinRequest(host="remote/hand", pid=1))
    assert (reply.session, set(reply.params), reply.watched) == ("apart", {"hand"}, [("hand", "hand")])
    assert reply.plan == seen
    assert joined_hosts.join(JoinRequest(host="other", pid=2)).plan == plan
    with pytest.raises(MessageError, match="host 'other' has no participant 'hand' that could fail"):
        joined_hosts.join(JoinRequest(host="other", pid=2, failed="hand: unplugged"))


def test_what_a_host_elsewhere_sees_of_a_session_is_enough_to_step_in_it(loaded):
    file = loaded("participants.far.host=remote")
    plan, _ = plan_of(file.scenario, file.params)
    seen = plan.seen_from("remote/far")
    assert seen.order == ("near", "far")
    assert {(k.source, k.target) for k in seen.connections} == {("near", "far"), ("far", "near")}
    assert seen.participants["far"] == plan.participants["far"]
    assert seen.output_stride("far", "out") == plan.output_stride("far", "out")


def test_rules_are_for_remote_participants_and_the_observer(loaded):
    file = loaded()
    plan, _ = plan_of(file.scenario, file.params)
    access = access_settings(plan, "apart")["access_control"]
    assert access["default_permission"] == "deny"
    names = [name for subject in access["subjects"] for name in subject.get("cert_common_names", ())]
    assert names == ["hand", "observer"]
    rules = {rule["id"]: rule for rule in access["rules"]}
    assert set(rules) == {name for policy in access["policies"] for name in policy["rules"]}
    of_hand = [
        rules[name]
        for policy in access["policies"]
        if policy["subjects"] == ["hand"]
        for name in policy["rules"]
    ]
    assert [
        rule["key_exprs"] for rule in of_hand if "put" in rule["messages"] and "ingress" in rule["flows"]
    ] == [["trocar/apart/device/hand/**"]]
    assert not [
        key
        for rule in of_hand
        for key in rule["key_exprs"]
        if "near" in key or "far" in key or key.endswith("hub/grant")
    ]


def test_a_hub_without_a_certificate_does_not_listen_to_other_machines(loaded, tmp_path):
    with pytest.raises(
        ConnectError, match=r"there is no certificate .*hub\.pem.*To create it: trocar certs init"
    ):
        launch(loaded(), outside=["tls/0.0.0.0:7447"], certificates=tmp_path)
    authority = Authority.founded(tmp_path / "certs")
    authority.renewed(-0.01)
    with pytest.raises(
        ConnectError, match=r"hub\.pem is not valid: certificate has expired.*trocar certs renew"
    ):
        launch(loaded(), outside=["tls/0.0.0.0:7447"], certificates=authority.directory)


LOOKED_AT = """\
name: looked_at
step: 2 ms
pace: realtime
participants:
  jelly: {kind: "toys:Jelly"}
  camera: {kind: "toys:Camera", host: remote, period: 20 ms, file: "FILE"}
connections:
  - jelly.* -> camera.*
"""


@pytest.mark.long
def test_a_camera_elsewhere_that_is_lost_joins_again_and_gets_the_surface_again(loaded, tmp_path, caplog):
    file, endpoint = tmp_path / "shown.txt", f"tcp/127.0.0.1:{free_port()}"
    session = launch(loaded(text=LOOKED_AT.replace("FILE", str(file))), endpoint=endpoint)
    command = [sys.executable, "-P", "-m", "hub.command_line", "engine", "camera", "--connect", endpoint]

    def join_and_be_lost():
        """Start the camera, again if it fails, and kill it when it has shown a state after that at time 0."""
        while True:
            with subprocess.Popen(command, stderr=subprocess.DEVNULL) as camera:
                while camera.poll() is None:
                    words = file.read_text().split() if file.exists() else []
                    if words[:1] == [str(camera.pid)] and int([*words, "0"][1]) > 0:
                        seen.append(words[-1])
                        camera.kill()
                        return
                    sleep(0.02)

    def lose_twice():
        join_and_be_lost()
        join_and_be_lost()
        session.state.shutdown()

    seen = []
    thread = Thread(target=lose_twice)
    thread.start()
    summary = session.run()
    thread.join()
    assert summary.state == "done"
    assert seen == ["3", "3"]
    assert "its host is gone; start 'trocar engine camera' again" in caplog.text
