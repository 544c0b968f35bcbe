"""Recordings of the server's directory: which are listed, who may open them, and never with trust."""

import json
import shutil
from urllib.parse import quote

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

import trocar
from hub.observation.recorded_measures import recorded_measures
from tests.webconsole.conftest import finish, served
from tests.webconsole.recorded_scene import write_scene
from tests.webconsole.test_gate import Visitor
from tests.webconsole.test_page import LIMIT_S, answer
from webconsole.library import home_of
from webconsole.recorded import Recorded

SCENARIO = """
name: short
step: 5 ms
duration: 50 ms
scene: {arms: {PSM1: {instrument: palpation-probe}}}
participants:
  robot: {kind: mujoco, looks: false}
measure:
  least_height_m: {kind: least, of: robot.PSM1/measured_cp.position.z, unit: m}
  later_m: {kind: least, of: robot.PSM1/measured_cp.position.z, unit: m, after: 9 s}
outcome: {text: "the tip went down to {least_height_m}", success: {least_height_m: {most: 1}}}
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """Two recordings, one below `recordings`, a copy that is cut short, and links that lead out."""
    home = tmp_path_factory.mktemp("library") / "home"
    home.mkdir()
    write_scene(home / "first")
    scenario = home / "short.yaml"
    scenario.write_text(SCENARIO)
    trocar.run(scenario, record=home / "recordings" / "short-1", one_host=True)
    (home / "cut").mkdir()
    (file,) = (home / "first").glob("*.mcap")
    (home / "cut" / "cut.mcap").write_bytes(file.read_bytes()[:-100])
    (home / "broken.mcap").write_bytes(b"no recording")
    outside = home.parent / "outside"
    shutil.copytree(home / "first", outside)
    (home / "linked").symlink_to(outside)
    return home


@pytest.fixture(scope="module")
def server(home):
    with served(Recorded(home / "first"), home=home) as server:
        yield server


def ask(server, path, role="operator"):
    response = Visitor(server).admit(role).get(path)
    return response.status, response.body.decode()


def test_the_list_has_the_directory_alone(server):
    status, text = ask(server, "/recordings")
    rows = {row["name"]: row for row in json.loads(text)}
    assert status == 200
    assert rows.keys() == {"first", "recordings/short-1", "cut", "broken.mcap"}
    assert [name for name, row in rows.items() if row["own"]] == ["first"]
    assert (rows["first"]["scenario"], rows["first"]["duration"]) == ("palpation", 0.96)
    assert "broken.mcap" in rows["broken.mcap"]["problem"]


def test_the_result_is_that_of_the_run(server, home):
    status, text = ask(server, f"/numbers?recording={quote('recordings/short-1')}")
    result = json.loads(text)
    assert (status, result["succeeded"]) == (200, True)
    assert result["text"].startswith("the tip went down to ")
    summary = trocar.run(home / "short.yaml", one_host=True)
    numbers = {one["name"]: one for one in result["numbers"]}
    value = numbers["least height"]["value"]
    assert (numbers["later"]["value"], numbers["least height"]["reason"]) == (None, "")
    assert numbers["later"]["reason"] == "'robot.PSM1/measured_cp.position.z' published no value after 9 s"
    assert value == summary.measures["least_height_m"]
    assert recorded_measures(Recorded(home / "recordings" / "short-1").recording).results() == {
        "least_height_m": value,
        "later_m": None,
    }


@pytest.mark.parametrize("name", ["linked", "../outside", "/etc/passwd", "first/../first", "", "fist"])
def test_a_name_that_is_not_listed_opens_nothing(server, name):
    status, text = ask(server, f"/series?port=tissue.probe/wrench&recording={quote(name, safe='')}")
    assert status == 400
    assert "there is no recording" in text
    if name == "fist":
        assert "Did you mean 'first'?" in text


def test_a_viewer_sees_the_recording_of_its_link_alone(server):
    assert ask(server, "/recordings", "viewer")[0] == 403
    assert ask(server, "/scene?recording=cut", "viewer")[0] == 403
    assert ask(server, "/numbers", "viewer")[0] == 200
    assert finish(closed(server, "cut", "viewer")) == (4002, "a viewer opens no other recording")


def test_a_page_of_an_unknown_recording_says_so(server):
    code, reason = finish(closed(server, "fist"))
    assert (code, reason[:29]) == (4002, "there is no recording 'fist' ")


async def closed(server, name, role="operator"):
    """Return why a page is closed."""
    async with page(server, name, role) as socket:
        with pytest.raises(ConnectionClosed):
            await socket.recv()
        return socket.close_code, socket.close_reason


def page(server, name, role="operator"):
    visitor = Visitor(server).admit(role)
    headers = {"Cookie": visitor.cookie, "Origin": f"http://{visitor.host}"}
    url = f"ws://{visitor.host}/page?recording={quote(name, safe='')}"
    return connect(url, additional_headers=headers, origin=None, open_timeout=LIMIT_S)


def test_pages_of_two_recordings_are_served_beside_each_other(server):
    async def body():
        async with page(server, "cut") as one, page(server, "recordings/short-1") as other:
            return [(await answer(socket, **{"is": "state"})) for socket in (one, other)]

    cut, short = finish(body())
    assert (cut["session"], short["session"]) == ("palpation", "short")
    assert cut["end"] == pytest.approx(0.96, abs=0.02), "the whole part of a recording that was cut short"


def test_the_directory_of_a_recording_is_where_others_are(tmp_path, monkeypatch):
    write_scene(tmp_path / "first", 2)
    (file,) = (tmp_path / "first").glob("*.mcap")
    alone = tmp_path / "alone.mcap"
    alone.write_bytes(file.read_bytes())
    assert [home_of(place) for place in (tmp_path / "first", file, alone)] == [tmp_path] * 3
    monkeypatch.chdir(tmp_path / "first")
    assert home_of(None) == tmp_path / "first"
