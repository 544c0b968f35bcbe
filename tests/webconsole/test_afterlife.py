"""The page of `trocar run --open` after the session: the recording, until the last page has gone."""

import json
import os
import re
import signal
import subprocess
import sys
from contextlib import ExitStack, contextmanager

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from tests.waiting import until
from tests.webconsole.conftest import cookie_of, finish
from webconsole import afterlife
from webconsole.console import Console
from webconsole.pilot import Pilots

SCENARIO = """\
name: short
step: 1 ms
duration: {duration}
pace: realtime
participants:
  robot: {{kind: mujoco, looks: false, arms: {{PSM1: {{}}}}}}
"""


@contextmanager
def running(directory, duration, *arguments):
    """Run a session with its page; yield the process, what it says, and a connection to its page."""
    (directory / "short.yaml").write_text(SCENARIO.format(duration=duration))
    said = directory / "said.txt"
    command = [sys.executable, "-P", "-m", "trocar", "run", "short.yaml", "--open", *arguments]
    with (
        said.open("w") as out,
        subprocess.Popen(
            command, cwd=directory, stdout=out, stderr=out, env=os.environ | {"BROWSER": "true"}
        ) as run,
    ):
        try:
            link = until(lambda: re.search(r"http://(127\S+?)(/\S+)", said.read_text()))
            host, path = link.groups()
            headers = {"Cookie": cookie_of(host, path), "Origin": f"http://{host}"}
            yield run, said, lambda: connect(f"ws://{host}/page", additional_headers=headers, origin=None)
        finally:
            run.kill()


async def told(socket, kind):
    """Return the next message of a kind from the server."""
    while True:
        message = await socket.recv()
        if isinstance(message, str) and (content := json.loads(message))["is"] == kind:
            return content


async def closed(socket):
    """Return the code with which the server closes a page."""
    try:
        while True:
            await socket.recv()
    except ConnectionClosed as error:
        return error.rcvd.code


@pytest.mark.long
def test_the_page_shows_the_recording_and_goes_with_ctrl_c(tmp_path):
    async def body(page):
        async with page() as socket:
            assert (await told(socket, "session"))["kind"] == "live"
            assert await closed(socket) == 4001
        async with page() as socket:
            described = await told(socket, "session")
            assert described["kind"] == "recording"
            state = await told(socket, "state")
            assert state["end"] == pytest.approx(8.0)
            return described

    with running(tmp_path, "8 s", "--record", "one") as (run, said, page):
        finish(body(page))
        assert "short done" in said.read_text()
        until(lambda: "the page stays until it has been closed for a minute" in said.read_text())
        assert run.poll() is None
        run.send_signal(signal.SIGINT)
        assert run.wait(60) == 0
    assert "Traceback" not in said.read_text()


@pytest.mark.long
def test_without_a_recording_the_last_values_stay(tmp_path):
    async def body(page, said):
        async with page() as socket:
            assert (await told(socket, "session"))["kind"] == "live"
            while "the page stays" not in said.read_text():
                state = await told(socket, "state")
            assert (await told(socket, "state"))["state"] == "away", state

    with running(tmp_path, "8 s") as (run, said, page):
        finish(body(page, said))
        run.send_signal(signal.SIGINT)
        assert run.wait(60) == 0


@pytest.mark.long
def test_where_no_page_is_open_the_command_ends_with_the_session(tmp_path):
    with running(tmp_path, "4 s", "--record", "one") as (run, _, _):
        assert run.wait(120) == 0


class Ended:
    """A session that is over and was not recorded."""

    kind, generation, scenario, past, is_over = "live", 1, None, None, True


def test_the_server_ends_when_the_last_page_has_gone_for_a_while(monkeypatch):
    monkeypatch.setattr(afterlife, "_LEFT_S", 0.5)
    console = Console.__new__(Console)
    console.source, console.pilots = Ended(), Pilots()
    console.live_source = lambda: console.source
    pages, asked = iter([1, 1, 0, 1]), []

    def number():
        asked.append(next(pages, 0))
        return asked[-1]

    with ExitStack() as stack:
        finish(afterlife.Afterlife(console, stack).run(number, lambda: asked.append("stop")))
    assert asked[:4] == [1, 1, 0, 1]
    assert asked[-1] == "stop"
    assert asked.count(0) >= 3, "it waits beyond the first moment without a page"
