"""Sessions from a page: the form made from the models, what is wrong with its values, and the start."""

import json

import pytest

from schemas.errors import MessageError, ScenarioError
from tests.webconsole.conftest import served, until
from tests.webconsole.test_browser import Person
from tests.webconsole.test_fork import until_states
from tests.webconsole.test_gate import Visitor
from tests.webconsole.test_page import answer, run
from webconsole.commands import Start
from webconsole.live import Live
from webconsole.recorded import Recorded
from webconsole.start import start_arguments, start_form, wrong_fields

WRONG = {"duration": "-1", "teleop.scale": "2", "stylus.max_age": "3 kg"}


def asked(**given):
    return Start(do="start", scenario="table", **given)


def test_the_form_has_units_limits_choices_and_the_values_of_the_scenario():
    form = start_form("table")
    fields = {field["path"]: field for group in form["groups"] for field in group["fields"]}
    assert [group["kind"] for group in form["groups"]] == ["", "simulated-touch", "teleoperation", "mujoco"]
    assert (fields["step"]["value"], fields["step"]["unit"]) == (pytest.approx(1e-3), "s")
    scale = fields["teleop.scale"]
    assert (scale["kind"], scale["value"], scale["least"], scale["most"]) == ("number", 1.0, 0.0, 1.0)
    assert fields["teleop.law"]["choices"] == ["pose", "velocity"]
    assert (fields["robot.looks"]["kind"], fields["robot.looks"]["value"]) == ("switch", False)
    assert (fields["robot.seed"]["kind"], fields["robot.seed"]["value"]) == ("whole", None)
    assert "robot.model" not in fields, "it has one value only"
    assert form["devices"] == [{"name": "stylus", "kind": "simulated-touch"}]


def test_wrong_values_are_told_by_field_in_the_words_of_the_models(tmp_path):
    changes = [f"{path}={value}" for path, value in WRONG.items()]
    with pytest.raises(ScenarioError) as raised:
        start_arguments(asked(changes=changes), tmp_path)
    wrong = wrong_fields(raised.value, changes)
    assert wrong.keys() == WRONG.keys()
    assert "greater than 0" in wrong["duration"]
    assert "not a quantity in s" in wrong["stylus.max_age"]


def test_the_arguments_are_those_of_the_command_line(tmp_path):
    (tmp_path / "table").mkdir()
    order = asked(changes=["teleop.scale=0.5"], lead=["stylus"], pace="realtime")
    assert start_arguments(order, tmp_path) == [
        "run",
        "table",
        "--set=participants.stylus={kind: browser, host: remote}",
        "--set=teleop.scale=0.5",
        "--pace",
        "realtime",
        "--record",
        str(tmp_path / "table-2"),
    ]


@pytest.mark.parametrize(
    "given",
    [
        {"scenario": "../evil.yaml"},
        {"scenario": "none"},
        {"scenario": "table", "changes": ["participants.x={kind: 'os:system'}"]},
        {"scenario": "table", "lead": ["pad"]},
    ],
)
def test_a_page_starts_only_what_is_installed(given, tmp_path):
    with pytest.raises(MessageError):
        start_arguments(Start(do="start", **given), tmp_path)


def test_a_viewer_starts_nothing_and_gets_no_form(console_of_recording):
    async def body(socket):
        await socket.send('{"do": "start", "scenario": "table"}')
        assert "a viewer may look" in (await answer(socket, **{"is": "answer"}))["error"]

    run(body, console_of_recording, role="viewer")
    assert Visitor(console_of_recording).admit("viewer").get("/start").status == 403


@pytest.mark.alone
def test_a_server_does_not_show_what_its_own_pages_have_started(recording, tmp_path, monkeypatch):
    """It has a page of its own, which hosts its devices."""
    monkeypatch.chdir(tmp_path)
    live = Live(session="table")
    live.start()

    async def body(socket):
        order = {"do": "start", "scenario": "table", "changes": ["duration=600"], "pace": "realtime"}
        await socket.send(json.dumps(order))
        assert (await answer(socket, to="start"))["number"] == 1
        (going,) = await until_states(socket, ["live"])
        assert going["link"].startswith("http://127.0.0.1:")
        assert live.state["state"] == "away"
        await socket.send('{"do": "end", "number": 1}')
        await until_states(socket, ["ended"])

    with served(live) as server:
        run(body, server)
    assert [file.name for file in tmp_path.iterdir()] == ["table"], "it was recorded where the server runs"


def test_the_form_on_the_page(browser, recording):
    with served(Recorded(recording)) as server:
        one = Person(browser, f"http://127.0.0.1:{server.port}{server.gate.invite('operator')}")
        one.page.get_by_role("button", name="New session").click()
        one.page.get_by_label("scenario", exact=True).select_option("table")
        one.page.get_by_text("down to a virtual table").wait_for()
        one.page.get_by_text("teleop (teleoperation)").click()
        scale = one.page.get_by_label("scale", exact=True)
        until(lambda: (scale.input_value(), scale.get_attribute("max")) == ("1", "1"))
        assert one.page.get_by_label("max_age (s)").count() == 2
        scale.fill("2")
        one.page.get_by_role("button", name="Start", exact=True).click()
        one.page.get_by_text("Input should be less than or equal to 1").wait_for()
        assert scale.get_attribute("aria-invalid") == "true"
        assert one.errors == []
        one.context.close()
