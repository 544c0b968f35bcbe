"""Sessions from a page: the form made from the models, what is wrong with its values, and the start."""

import json

import pytest

from schemas.errors import MessageError, ScenarioError
from tests.waiting import until
from tests.webconsole.conftest import served
from tests.webconsole.test_browser import Person
from tests.webconsole.test_fork import until_states
from tests.webconsole.test_gate import Visitor
from tests.webconsole.test_page import answer, run
from webconsole.changes import wrong_fields
from webconsole.commands import Start
from webconsole.live import Live
from webconsole.recorded import Recorded
from webconsole.start import start_arguments, start_form


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
    assert (fields["robot.looks"]["kind"], fields["robot.looks"]["value"]) == ("choice", "none")
    assert (fields["robot.lean"]["kind"], fields["robot.lean"]["value"]) == ("switch", False)
    assert (fields["robot.seed"]["kind"], fields["robot.seed"]["value"]) == ("whole", None)
    assert "robot.model" not in fields, "it has one value only"
    assert form["devices"] == [{"name": "stylus", "kind": "simulated-touch"}]


@pytest.mark.parametrize(
    "wrong",
    [
        {"duration": (-1, "greater than 0"), "teleop.scale": (2, "less than or equal to 1")},
        {
            "stylus.max_age": ("3 kg", "expected a number in s"),
            "teleop.law": ("/etc/passwd", "expected one of pose, velocity"),
            "robot.lean": (1, "expected true or false"),
            "robot.seed": (True, "expected a whole number"),
        },
    ],
)
def test_wrong_values_are_told_by_field_in_the_words_of_the_models(wrong, tmp_path):
    changes = {path: value for path, (value, _) in wrong.items()}
    with pytest.raises(ScenarioError) as raised:
        start_arguments(asked(changes=changes), tmp_path)
    told = wrong_fields(raised.value, changes)
    assert told.keys() == wrong.keys()
    for path, (_, message) in wrong.items():
        assert message in told[path]


def test_a_wrong_value_with_a_colon_is_told_without_the_value(tmp_path):
    changes = {"teleop.law": "a: b"}
    with pytest.raises(ScenarioError) as raised:
        start_arguments(asked(changes=changes), tmp_path)
    assert wrong_fields(raised.value, changes) == {"teleop.law": "expected one of pose, velocity"}


def test_the_arguments_are_those_of_the_command_line(tmp_path):
    (tmp_path / "table").mkdir()
    changes = {"teleop.scale": 5e-5, "teleop.law": "velocity", "robot.lean": True, "robot.seed": None}
    order = asked(changes=changes, lead=["stylus"], pace="realtime")
    assert start_arguments(order, tmp_path) == [
        "run",
        "table",
        "--set=participants.stylus={kind: browser, host: remote}",
        "--set=teleop.scale=5e-05",
        '--set=teleop.law="velocity"',
        "--set=robot.lean=true",
        "--set=robot.seed=null",
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
        {"scenario": "table", "changes": {"participants.x": "{kind: 'os:system'}"}},
        {"scenario": "table", "changes": {"robot.model": "/dev/zero"}},
        {"scenario": "table", "changes": {"robot.host": "remote"}},
        {"scenario": "table", "changes": {"stylus.kind": "ros2-dds"}},
        {"scenario": "ros", "changes": {"ros.namespace": "elsewhere"}},
        {"scenario": "ros-dds", "changes": {"ros.discovery": "subnet"}},
        {"scenario": "ros-dds", "changes": {"ros.domain": 5}},
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
        order = {"do": "start", "scenario": "table", "changes": {"duration": 600}, "pace": "realtime"}
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
