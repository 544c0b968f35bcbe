"""Foxglove's face, by a client that speaks its protocol: what it gets, and who gets nothing."""

import asyncio
import http.client
import json
import re
import ssl
import struct
import subprocess
import sys
from contextlib import contextmanager
from importlib.resources import files
from threading import Thread

import pytest

pytest.importorskip("foxglove", reason="needs trocar[foxglove]")

from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from schemas.codec import decode
from schemas.errors import ScenarioError
from schemas.ros import JointState
from schemas.trocar_msgs import SessionStatus
from tests.waiting import until
from tests.webconsole.conftest import finish
from webconsole.command_line import view
from webconsole.console import Console
from webconsole.foxglove.face import Face
from webconsole.listening import on_loopback
from webconsole.live import Live
from webconsole.pilot import Pilots
from webconsole.server import Server

PROTOCOL = "foxglove.sdk.v1"
MESSAGE_DATA = 1
SCENE, TF, JOINTS, STATUS = "/robot/scene", "/robot/tf", "/robot/PSM1/measured_js", "/hub/status"


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A running session with one arm, and the server of its page with Foxglove's face."""
    file = tmp_path_factory.mktemp("foxglove") / "arm.yaml"
    file.write_text(
        "name: looked_at\nstep: 5 ms\npace: realtime\nscene: {arms: {PSM1: {instrument: palpation-probe}}}\n"
        "participants: {robot: {kind: mujoco, looks: false}}\n"
    )
    with session(file) as (server, face):
        yield server, face


@contextmanager
def session(file):
    quiet = subprocess.DEVNULL
    live = Live(session="looked_at")
    live.start()
    console = Console(live, Pilots())
    face = Face(console)
    server = Server(console, on_loopback(0), {"/foxglove": face.relay})
    thread = Thread(target=server.run)
    thread.start()
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "trocar", "run", str(file)], stdout=quiet, stderr=quiet
    ) as hub:
        try:
            until(lambda: live.generation)
            yield server, face
        finally:
            hub.kill()
            server.stop()
            thread.join()
            face.close()


class Client:
    """A client of Foxglove's WebSocket protocol (https://github.com/foxglove/ws-protocol)."""

    def __init__(self, socket):
        self.socket, self.channels, self.subscribed = socket, {}, []

    def take(self, text):
        """Take what the server says; return the topics that it offers now."""
        said = json.loads(text)
        offered = {one["topic"]: one for one in said["channels"]} if said["op"] == "advertise" else {}
        self.channels |= offered
        return offered.keys()

    async def offered(self, *topics):
        """Read until these topics are offered; return each one's description by name."""
        while not {*topics} <= self.channels.keys():
            self.take(await self.socket.recv())
        return self.channels

    async def subscribe(self, topics):
        wanted = []
        for topic in topics:
            self.subscribed.append(topic)
            wanted.append({"id": len(self.subscribed) - 1, "channelId": self.channels[topic]["id"]})
        if wanted:
            await self.socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    async def values(self, *topics):
        """Subscribe, also to what is offered anew, and return the first message of each: time (ns), bytes."""
        await self.subscribe(topics)
        found = {}
        while len(found) < len(topics):
            data = await self.socket.recv()
            if isinstance(data, str):
                offered = self.take(data)
                await self.subscribe([topic for topic in topics if topic in offered])
            elif data[0] == MESSAGE_DATA:
                subscription, time_ns = struct.unpack_from("<IQ", data, 1)
                found.setdefault(self.subscribed[subscription], (time_ns, data[13:]))
        return found


def opened(server, link=None, name="127.0.0.1", **headers):
    """Connect as a program, or as the browser of a website, that has a link or not."""
    path = server.gate.link("/foxglove") if link is None else link
    return connect(
        f"ws://{name}:{server.port}{path}",
        host="127.0.0.1",
        port=server.port,
        subprotocols=[PROTOCOL],
        additional_headers=headers,
        max_size=None,
        max_queue=None,
    )


def look(server, *topics, **headers):
    async def body():
        async with asyncio.timeout(60), opened(server, **headers) as socket:
            client = Client(socket)
            channels = await client.offered(*topics)
            return channels, await client.values(*topics)

    return finish(body())


def test_bodies_poses_numbers_and_the_status_arrive(served):
    channels, values = look(served[0], SCENE, TF, JOINTS, STATUS)
    assert channels[JOINTS]["encoding"] == "cdr"
    assert channels[JOINTS]["schemaEncoding"] == "ros2msg"
    assert "float64[] position" in channels[JOINTS]["schema"]
    assert channels[TF]["schemaName"] == "foxglove.FrameTransforms"
    assert channels[SCENE]["schemaName"] == "foxglove.SceneUpdate"
    time_ns, joints = values[JOINTS]
    assert time_ns > 0
    assert len(decode(JointState, joints).position) == 6
    assert decode(SessionStatus, values[STATUS][1]).state == "running"
    assert b"robot/PSM1" in values[TF][1]
    assert b"robot/PSM1" in values[SCENE][1]


def test_who_comes_later_gets_the_shapes_too(served):
    async def body():
        async with asyncio.timeout(60), opened(served[0]) as one, opened(served[0]) as other:
            for socket in (one, other):
                client = Client(socket)
                await client.offered(SCENE)
                assert (await client.values(SCENE))[SCENE][1]

    finish(body())


def test_a_client_can_send_nothing(served):
    async def body():
        async with asyncio.timeout(60), opened(served[0]) as socket:
            client = Client(socket)
            await client.offered(JOINTS)
            given = {"id": 1, "topic": "/robot/servo", "encoding": "cdr", "schemaName": "std_msgs/msg/String"}
            for order in (
                {"op": "advertise", "channels": [given]},
                {"op": "setParameters", "parameters": [{"name": "pace", "value": 1}]},
            ):
                await socket.send(json.dumps(order))
                while (said := json.loads(await socket.recv()))["op"] != "status":
                    pass
                assert "does not support" in said["message"]

    finish(body())


@pytest.mark.long
@pytest.mark.parametrize(
    ("link", "headers"),
    [
        ("/foxglove", {}),
        ("/foxglove?token=guessed", {}),
        (None, {"name": "evil.example"}),
        ("/foxglove", {"Origin": "https://app.foxglove.dev"}),
        ("/page", {}),
    ],
    ids=["no token", "a guessed token", "another host", "a website", "the page's own socket"],
)
def test_who_has_no_link_gets_nothing_and_is_logged(served, caplog, link, headers):
    async def body():
        async with opened(served[0], link, **headers):
            pass

    with pytest.raises(InvalidStatus, match="403"):
        finish(body())
    assert "refused websocket" in caplog.text


def test_a_link_of_foxglove_opens_no_page(served):
    link = served[0].gate.link("/foxglove")
    for path in (link, link.replace("/foxglove", "/"), link.replace("/foxglove", "/scene")):
        connection = http.client.HTTPConnection("127.0.0.1", served[0].port)
        connection.request("GET", path)
        assert connection.getresponse().status == 403
        connection.close()


def test_browsers_do_not_accept_the_certificate_of_the_inner_server(served):
    """So a website that finds its port gets nothing: of a WebSocket, a browser asks nobody."""

    async def body(refusal, **given):
        with refusal:
            async with connect(f"{given.pop('scheme')}://127.0.0.1:{served[1].port}", **given):
                pass
        await asyncio.sleep(0.1)  # asyncio closes the transport of a failed handshake in its next rounds

    untrusted = pytest.raises(ssl.SSLCertVerificationError)
    finish(body(untrusted, scheme="wss", ssl=ssl.create_default_context(), subprotocols=[PROTOCOL]))
    silent = pytest.raises(Exception, match=r"did not receive a valid HTTP response|Connection reset")
    finish(body(silent, scheme="ws", subprotocols=[PROTOCOL]))


def test_a_recording_is_opened_by_foxglove_itself(tmp_path):
    with pytest.raises(ScenarioError, match="opens the file"):
        view(tmp_path, foxglove=True)


@pytest.mark.long
def test_the_layout_names_topics_that_sessions_have():
    text = (files("webconsole.foxglove") / "layout.json").read_text(encoding="utf-8")
    layout = json.loads(text)
    panels = set(layout["configById"])
    assert (
        set(re.findall(r'"((?:3D|Image|Plot|RawMessages)![a-z]+)"', json.dumps(layout["layout"]))) == panels
    )
    topics = set(re.findall(r'"(/[\w/]+)', text))
    assert {"/robot/scene", "/hub/status", "/endoscope/left/image_raw/compressed"} <= topics
