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
from tests.webconsole.test_browser import Person
from tests.webconsole.test_page import answer, run
from webconsole.commands import Fork, command
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
    assert {"teleop.scale=1.0", 'teleop.law="pose"', 'robot.looks="none"'} <= {*form["parameters"]}


def test_the_arguments_are_those_of_the_command_line(table):
    given = asked(changes={"teleop.scale": 0.1}, lead=["stylus"], duration=60.0, pace="realtime")
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
    "changes",
    [
        {"participants.x": "{kind: fmu, path: model.fmu}"},
        {"participants.stylus": "{kind: ros2-dds, discovery: subnet}"},
        {"stylus.kind": "ros2-dds"},
        {"stylus.host": "remote"},
        {"teleop.frame": "/etc/passwd"},
        {"robot.model": "!!binary L2V0Yy9wYXNzd2Q="},
        {"robot": True},
        {"name": "other"},
        {"answer_limit": 1},
    ],
)
def test_a_page_changes_what_a_form_offers_and_nothing_else(table, changes):
    with pytest.raises(MessageError, match="cannot be changed from a page"):
        fork_arguments(Recording(table), asked(changes=changes))


@pytest.mark.parametrize("value", [[1.0], {"kind": "fmu"}, float("nan"), "x" * 101])
def test_a_change_is_a_value_of_json_without_parts(value):
    with pytest.raises(MessageError, match=r"not a command: fork\.changes\.teleop\.scale"):
        command(json.dumps({"do": "fork", "time": 0.02, "changes": {"teleop.scale": value}}))


def test_a_word_for_a_number_is_no_value(table):
    with pytest.raises(ScenarioError, match="expected a number"):
        fork_arguments(Recording(table), asked(changes={"teleop.scale": "!!binary c2Vjb25k"}))


def test_a_device_that_is_not_there_is_not_led(table):
    with pytest.raises(MessageError, match="no device 'pad'"):
        fork_arguments(Recording(table), asked(lead=["pad"]))


def test_a_viewer_forks_nothing(table):
    async def body(socket):
        await socket.send('{"do": "fork", "time": 0.02}')
        assert "a viewer may look" in (await answer(socket, **{"is": "answer"}))["error"]
        assert "started" not in await answer(socket, **{"is": "state"})

    with served(Recorded(table)) as server:
        run(body, server, role="viewer")


@pytest.mark.long
def test_processes_that_wait_for_nothing_end_with_the_server():
    started = Started()
    started.prepare(["no.such.module"])
    started.prepare(["no.such.module"])
    hub, page = started.waiting
    started.close()
    assert (hub.returncode, page.returncode) == (0, 0)


@pytest.mark.long
def test_a_page_forks_and_follows(table):
    """One fork fails with the words of the command line; another one is live until it is ended."""

    async def body(socket):
        await socket.send('{"do": "prepare"}')  # the form is open
        for duration in (0.01, 600.0):
            changes = {"teleop.scale": 0.1}
            order = {"do": "fork", "time": 0.02, "changes": changes, "duration": duration, "pace": "realtime"}
            await socket.send(json.dumps(order))
        assert [(await answer(socket, to="fork"))["number"] for _ in range(2)] == [1, 2]
        failed, going = await until_states(socket, ["failed", "live"])
        assert "ends at 0.01 s, before it is forked at 0.02 s" in failed["error"]
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


def test_the_form_of_a_fork_on_the_page(browser, table):
    with served(Recorded(table)) as server:
        one = Person(browser, f"http://127.0.0.1:{server.port}{server.gate.invite('operator')}")
        one.page.get_by_role("button", name="Fork here").click()
        one.page.get_by_label("Add a parameter").select_option("teleop.scale=1.0")
        changes = one.page.get_by_label("Changes, one a line")
        assert changes.input_value() == "teleop.scale=1.0"
        for line, why in (
            ("teleop.scale = fast", "expected a number"),
            ("teleop.law=velocity\nteleop.scal = 1", "Did you mean 'teleop.scale'?"),
            ("teleop.scale={}", "not a command"),
        ):
            changes.fill(line)
            one.page.get_by_role("button", name="Fork", exact=True).click()
            one.page.locator("#fork-error").get_by_text(why).wait_for()
        assert one.errors == []
        one.context.close()


async def until_states(socket, states):
    async with asyncio.timeout(60):
        while True:
            started = (await answer(socket, **{"is": "state"}))["started"]
            if [one["state"] for one in started] == states:
                return started
