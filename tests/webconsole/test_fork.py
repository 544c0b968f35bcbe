"""Forks from a page: what is asked for is checked, started as a process of its own, and followed."""

import asyncio
import json

import pytest

from hub.planning.scenario_file import load
from hub.recording.fork_origin import fork_origin
from hub.recording.recording import Recording
from hub.session.launch import launch
from schemas.errors import MessageError, ScenarioError
from tests.webconsole.conftest import served
from tests.webconsole.test_page import answer, run
from webconsole.commands import Fork
from webconsole.fork import fork_arguments, fork_form, tree_of
from webconsole.recorded import Recorded
from webconsole.started import Started


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """A short recording of `table`."""
    directory = tmp_path_factory.mktemp("forks") / "table"
    file = load("table", ["pace=fast", "duration=40 ms"])
    launch(file, record=directory, one_host=True, endpoint="tcp/127.0.0.1:0").run()
    return directory


def asked(**given):
    return Fork(do="fork", time=0.02, **given)


def test_the_form_offers_devices_and_numbers(table):
    form = fork_form(Recording(table))
    assert form["devices"] == [{"name": "stylus", "kind": "simulated-touch"}]
    assert any(one.startswith("teleop.scale=") for one in form["parameters"])


def test_the_arguments_are_those_of_the_command_line(table):
    given = asked(changes=["teleop.scale=0.1"], lead=["stylus"], duration=60.0, pace="realtime")
    arguments = fork_arguments(Recording(table), given)
    assert arguments[2:7] == [
        "--at",
        "0.020000000 s",
        "--set=participants.stylus={kind: browser, host: remote}",
        "--set=teleop.scale=0.1",
        "--set=duration=60",
    ]
    assert arguments[7:] == ["--pace", "realtime", "--record", str(table.with_name("table-at-0.02s"))]


@pytest.mark.parametrize(
    "change",
    [
        "participants.x={kind: 'os:system'}",
        "participants.x={kind: fmu, path: model.fmu}",
        "participants.x={kind: fmu, file: ../../model.fmu}",
        "teleop.frame=/etc/passwd",
        "teleop.frame='\\\\\\\\server\\\\share'",
        "participants.x={kind: mujoco, 'a/b': 1}",
    ],
)
def test_a_page_names_neither_classes_nor_files(table, change):
    with pytest.raises(MessageError, match="from a page"):
        fork_arguments(Recording(table), asked(changes=[change]))


def test_what_is_no_change_is_refused_as_on_the_command_line(table):
    with pytest.raises(ScenarioError, match=r"--set pace: expected a\.b\.c=value"):
        fork_arguments(Recording(table), asked(changes=["pace"]))
    with pytest.raises(MessageError, match="no device 'pad'"):
        fork_arguments(Recording(table), asked(lead=["pad"]))


def test_a_viewer_forks_nothing(table):
    async def body(socket):
        await socket.send('{"do": "fork", "time": 0.02}')
        assert "a viewer may look" in (await answer(socket, **{"is": "answer"}))["error"]
        assert "started" not in await answer(socket, **{"is": "state"})

    with served(Recorded(table)) as server:
        run(body, server, role="viewer")


def test_processes_that_wait_for_nothing_end_with_the_server():
    started = Started()
    started.prepare(["no.such.module"])
    started.prepare(["no.such.module"])
    hub, page = started.waiting
    started.close()
    assert (hub.returncode, page.returncode) == (0, 0)


def test_a_page_forks_and_follows(table):
    """One fork fails with the words of the command line; another one is live until it is ended."""

    async def body(socket):
        await socket.send('{"do": "prepare"}')  # the form is open
        for changes in (["teleop.scal=0.1"], ["teleop.scale=0.1"]):
            order = {"do": "fork", "time": 0.02, "changes": changes, "duration": 600.0, "pace": "realtime"}
            await socket.send(json.dumps(order))
        assert [(await answer(socket, to="fork"))["number"] for _ in range(2)] == [1, 2]
        failed, going = await until_states(socket, ["failed", "live"])
        assert "Did you mean 'scale'?" in failed["error"]
        assert going["link"].startswith("http://127.0.0.1:")
        await socket.send('{"do": "end", "number": 3}')
        assert "no session 3" in (await answer(socket, to="end"))["error"]
        await socket.send('{"do": "end", "number": 2}')
        await until_states(socket, ["failed", "ended"])

    with served(Recorded(table)) as server:
        run(body, server)
    fork = next(one for one in table.parent.iterdir() if one.name.startswith("table-at-"))
    origin = fork_origin(Recording(fork))
    assert (origin.time_ns, origin.changes[0]) == (20_000_000, "teleop.scale=0.1")
    tree = tree_of(Recording(table))
    assert [(one["depth"], one["at"], one["shown"]) for one in tree] == [(0, None, True), (1, 0.02, False)]


async def until_states(socket, states):
    async with asyncio.timeout(60):
        while True:
            started = (await answer(socket, **{"is": "state"}))["started"]
            if [one["state"] for one in started] == states:
                return started
