"""What is left of the sessions that a page has started when the server of that page is ended or killed."""

import asyncio
import json
import os
import re
import signal
import subprocess
import sys

import pytest
from websockets.asyncio.client import connect

from hub.recording.recording import Recording
from hub.transport.session_secret import private_directory
from tests.faults.traces import MARK, living
from tests.hub.sample_session import write_session
from tests.waiting import until
from tests.webconsole.conftest import cookie_of, finish
from tests.webconsole.test_page import answer

pytestmark = [
    pytest.mark.search,
    pytest.mark.skipif(sys.platform != "linux", reason="it looks for what is left in /proc"),
]


@pytest.fixture
def server(tmp_path):
    """`trocar view` of a recording, with all its files in one directory; its processes have a mark."""
    write_session(tmp_path / "recording", seconds=0.05)
    (tmp_path / "temporary").mkdir()
    given = {MARK: tmp_path.name, "TMPDIR": str(tmp_path / "temporary")}
    with (
        (tmp_path / "said").open("wb") as said,
        subprocess.Popen(
            [sys.executable, "-P", "-m", "trocar", "view", "--no-open", str(tmp_path / "recording")],
            cwd=tmp_path,
            env=os.environ | given,
            stdout=said,
            stderr=said,
        ) as process,
    ):
        yield process
        for one in living(tmp_path.name):
            os.kill(one.pid, signal.SIGKILL)


def start_session(link):
    """Start a session by the link of an operator, and wait until its own page is there."""
    host, path = re.fullmatch(r"http://([^/]+)(/.*)", link).groups()
    cookie = cookie_of(host, path)

    async def body():
        headers = {"Cookie": cookie, "Origin": f"http://{host}"}
        async with connect(f"ws://{host}/page", additional_headers=headers, origin=None) as socket:
            order = {"do": "start", "scenario": "table", "changes": {"duration": 600}, "pace": "realtime"}
            await socket.send(json.dumps(order))
            async with asyncio.timeout(100):
                states = []
                while states != ["live"]:
                    states = [one["state"] for one in (await answer(socket, **{"is": "state"}))["started"]]
            await socket.send('{"do": "prepare"}')

    finish(body())


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
def test_sessions_of_a_page_end_with_its_server(server, tmp_path, number):
    said = tmp_path / "said"
    start_session(until(lambda: re.search(r"http://127\S+", said.read_text()), 100.0)[0])
    assert len(living(tmp_path.name)) >= 3, "server, hub and page of the session"
    temporary = tmp_path / "temporary"

    def left():
        return [file for file in temporary.rglob("*") if file.name.startswith("tmp")]

    until(lambda: not left(), 100.0)  # of the output of a prepared process that starts
    server.send_signal(number)
    server.wait(100)
    until(lambda: not living(tmp_path.name), 100.0)
    assert [file for file in temporary.rglob("*") if file.name != private_directory().name] == []
    statuses = [status for _, status in Recording(tmp_path / "table").statuses()]
    assert "interrupted" in statuses[-1].detail, "the recording was closed in order"
    assert "Traceback" not in said.read_text()
