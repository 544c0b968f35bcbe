from __future__ import annotations

import json
import threading
from collections.abc import Generator

import pytest
from typer.testing import CliRunner

from devices.ros.command_line import app
from hub.remote.live_sessions import live_places
from hub.transport.loopback_port import LoopbackPort
from hub.transport.session_secret import listen_with_secret
from schemas.codec import encode
from schemas.keys import Keys
from schemas.ros import StringMessage
from schemas.trocar_msgs import GatewayClient, GatewayStatus, GatewayTopic
from tests.hub.authorities import free_endpoint

PLACE = "ROS_DOMAIN_ID=3"
STATUS = GatewayStatus(
    kind="ros2-dds",
    clients=[GatewayClient(name="/console", address="10.0.0.7")],
    topics=[
        GatewayTopic(
            topic="/PSM1/servo_jp",
            way="subscribe",
            rate=0.0,
            messages=3,
            refused=1,
            reason="5 values in position, expected 6",
        ),
        GatewayTopic(topic="/PSM1/measured_js", way="publish", rate=99.97, messages=1000),
    ],
)


@pytest.fixture
def endpoint() -> Generator[str]:
    """A hub with a gateway that publishes its status every 0.1 s, and with one that publishes nonsense."""
    endpoint, over = free_endpoint(), threading.Event()

    def tell() -> None:
        while not over.wait(0.1):
            hub.put(Keys("surgery").output("device", "ros", "gateway"), encode(STATUS))
            hub.put(Keys("surgery").output("device", "ros", "place"), encode(StringMessage(data=PLACE)))
            for port in ("gateway", "place"):
                hub.put(Keys("surgery").output("device", "broken", port), b"nonsense")

    with listen_with_secret(LoopbackPort(endpoint)) as hub:
        teller = threading.Thread(target=tell)
        teller.start()
        yield endpoint
        over.set()
        teller.join()


def test_people_see_who_is_connected_and_what_goes_through(endpoint: str) -> None:
    shown = CliRunner().invoke(app, ["--connect", endpoint], env={"COLUMNS": "160"}).stdout
    assert "ros (ros2-dds) in session 'surgery' at ROS_DOMAIN_ID=3, connected: /console (10.0.0.7)" in shown
    lines = [line.split() for line in shown.splitlines()]
    assert ["/PSM1/measured_js", "published", "100.0", "1000"] in lines
    assert "5 values in position, expected 6" in shown
    assert "broken" not in shown


def test_programs_get_json(endpoint: str) -> None:
    (found,) = json.loads(CliRunner().invoke(app, ["--connect", endpoint, "--json"]).stdout)
    assert found == {"session": "surgery", "gateway": "ros", "place": PLACE} | STATUS.model_dump()


def test_a_list_of_sessions_has_their_places(endpoint: str) -> None:
    assert live_places([endpoint]) == {("surgery", "ros"): PLACE}


def test_nobody_there() -> None:
    result = CliRunner().invoke(app, ["--connect", free_endpoint()])
    assert result.exit_code == 0
    assert "no gateway to ROS is running" in result.stdout


def test_programs_over_zenoh_meet_at_the_hub(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    over_zenoh = STATUS.model_copy(update={"kind": "ros2-zenoh"})
    monkeypatch.setitem(globals(), "STATUS", over_zenoh)
    (found,) = json.loads(CliRunner().invoke(app, ["--connect", endpoint, "--json"]).stdout)
    assert found["place"] == f"{endpoint}, {PLACE}"
