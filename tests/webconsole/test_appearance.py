"""Textures of a page: loaded by their hashes, drawn in a browser, left out where that takes too long."""

import gzip
import http.client
import json
import struct
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from hub.participant import Params
from hub.participant.appearance import RestBody
from schemas.scenario import Scenario
from tests.webconsole.conftest import cookie_of, served
from tests.webconsole.recorded_cut import write_cut
from tests.webconsole.test_browser import Person
from webconsole import appearance
from webconsole.appearance import find_appearance
from webconsole.recorded import Recorded

SCENARIO = Scenario.model_validate(
    {"name": "cut", "step": "1 ms", "duration": "1 s", "participants": {"tissue": {"kind": "toys:Busy"}}}
)
BODY = RestBody(np.eye(4, 3, dtype=np.float32), np.array([[0, 2, 1], [0, 1, 3]], np.uint32))
TISSUE = "trocar.scene.surfaces[0].mesh"
SMALL = {"width": 700, "height": 400}
"""Size of a window in which software draws quickly."""


def described(packed):
    """Return the description in the answer of an appearance, and its numbers."""
    data = gzip.decompress(packed)
    (size,) = struct.unpack_from("<I", data)
    return json.loads(data[4 : 4 + size]), data[4 + size :]


def array(numbers, place, kind):
    return np.frombuffer(numbers, kind, place["count"], place["at"])


@pytest.fixture(scope="module")
def served_cut(tmp_path_factory):
    directory = tmp_path_factory.mktemp("appearance") / "palpation"
    block = write_cut(directory)
    with served(Recorded(directory)) as server:
        yield server, block


def get(server, cookie, path):
    connection = http.client.HTTPConnection("127.0.0.1", server.port)
    connection.request("GET", path, headers={"Cookie": cookie})
    answer = connection.getresponse()
    found = answer.status, {name.lower(): value for name, value in answer.headers.items()}, answer.read()
    connection.close()
    return found


@pytest.mark.long
def test_textures_are_loaded_by_their_hashes_and_may_be_kept(served_cut):
    server, block = served_cut
    cookie = cookie_of(f"127.0.0.1:{server.port}", server.gate.invite("viewer"))
    status, _, packed = get(server, cookie, "/appearance")
    found, numbers = described(packed)
    (surface,) = found["surfaces"]
    assert (status, found["place"]) == (200, "abdomen")
    assert np.allclose(array(numbers, surface["rest"], "<f4").reshape(-1, 3), block.mesh.nodes, atol=1e-6)
    assert surface["uv"]["count"] == 6 * len(block.mesh.triangles)
    for name in surface["texture"].values():
        status, headers, picture = get(server, cookie, f"/texture/{name}")
        assert (status, headers["content-type"], picture[:2]) == (200, "image/jpeg", b"\xff\xd8")
        assert "immutable" in headers["cache-control"]
    assert get(server, cookie, "/texture/nothing")[0] == 404
    assert get(server, "", f"/texture/{name}")[0] == 403
    assert get(server, cookie, "/appearance")[2] == packed


def test_a_kind_that_fails_leaves_the_page_plain(monkeypatch, caplog):
    def fail(_params, _bodies):
        raise RuntimeError("no paint")

    entry = EntryPoint("toys:Busy", f"{__name__}:unused", appearance.GROUP)
    monkeypatch.setattr(EntryPoint, "load", lambda _self: fail)
    monkeypatch.setattr(appearance, "entry_points", lambda **_asked: [entry])
    assert find_appearance(SCENARIO, lambda _: Params(), {"tissue.block/nodes": BODY}) is None
    assert "no paint" in caplog.text
    monkeypatch.setattr(appearance, "entry_points", lambda **_asked: [])
    assert find_appearance(SCENARIO, lambda _: Params(), {}) is None


@pytest.fixture
def person(browser, served_cut):
    server, _ = served_cut
    one = Person(browser, f"http://127.0.0.1:{server.port}{server.gate.invite('viewer')}")
    one.page.set_viewport_size(SMALL)
    one.sees("Boolean(trocar.scene?.placed && trocar.scene.surfaces[0]?.mesh)")
    yield one
    one.context.close()


def test_the_browser_draws_textures_blood_and_surroundings(person):
    looks = person.page.get_by_label("Looks of the scene")
    looks.select_option("plain")
    person.sees("trocar.scene.level === 'plain'")
    plain = person.picture()
    looks.select_option("full")
    person.sees("trocar.scene.level === 'full'")
    assert person.picture() != plain
    person.sees(
        "trocar.scene.renderer.toneMapping > 0 && trocar.scene.looks.surroundings.children.length > 2"
    )
    material = f"{TISSUE}.material.every((one) => one.map && one.normalMap && one.roughnessMap)"
    assert person.page.evaluate(material)
    assert person.page.evaluate(f"{TISSUE}.castShadow && {TISSUE}.receiveShadow")
    uv = f"{TISSUE}.geometry.attributes.uv.array"
    assert person.page.evaluate(f"{uv}.every((part) => part >= 0 && part <= 1)"), "within the atlas"
    steel = "trocar.scene.contents.rigid.filter(({ userData }) => userData.coat === 'steel')"
    assert person.page.evaluate(
        f"{steel}.length > 0 && {steel}.every(({{ material }}) => material.metalness > 0.5)"
    )

    person.page.get_by_role("slider", name="Instant of the recording").fill("0.4")
    person.sees(f"{TISSUE}.geometry.groups.length === 3")
    assert person.page.evaluate(f"{uv}.every(Number.isFinite)")
    person.sees("trocar.scene.surfaces[0].film.coat.visible")
    burns = "trocar.scene.surfaces[0].burns.coats"
    assert person.page.evaluate(f"{burns}.every(({{ visible }}) => visible)"), "ragged edges of the burn"
    person.picture()
    looks.select_option("simple")
    person.sees("!trocar.scene.surfaces[0].film.coat.visible && !trocar.scene.renderer.shadowMap.enabled")
    assert not person.page.evaluate(f"{burns}.some(({{ visible }}) => visible)")
    person.picture()
    looks.select_option("plain")
    person.sees("trocar.scene.level === 'plain' && !trocar.scene.looks.surroundings.visible")
    assert person.errors == []


def test_the_view_of_the_endoscope_is_darker_in_its_corners(person):
    person.page.get_by_label("Looks of the scene").select_option("simple")
    person.sees("trocar.scene.level === 'simple' && trocar.scene.looks.appearance")
    at = "pose: [0, 0, 0.2, 1, 0, 0, 0], fieldOfView: 1, baseline: 0"
    camera = f"{{ group: trocar.scene.bodies[0][0], {at} }}"
    person.page.evaluate(f"trocar.scene.cameras.push({camera})")  # the scene has no endoscope
    vignette = "getComputedStyle(document.getElementById('view'), '::before').opacity"
    for view, seen in (("endoscope", "0.35"), ("work", "0")):
        person.page.evaluate(f"trocar.scene.choose('{view}')")
        person.sees(f"{vignette} === '{seen}'")


def test_several_organs_are_first_seen_by_the_endoscope(person):
    opening = """([surfaces, cameras]) => Reflect.get(Object.getPrototypeOf(trocar.scene), "opening",
      { surfaces: Array(surfaces), cameras: Array(cameras) })"""
    seen = [person.page.evaluate(opening, counts) for counts in ([1, 1], [2, 0], [2, 1])]
    assert seen == ["work", "work", "endoscope"]


def test_pictures_of_a_still_recording_take_the_looks_of_the_scene(browser, tmp_path):
    write_cut(tmp_path / "palpation", "scene.arms.ECM={}")
    with served(Recorded(tmp_path / "palpation")) as server:
        one = Person(browser, f"http://127.0.0.1:{server.port}{server.gate.invite('viewer')}")
        one.page.set_viewport_size(SMALL)
        looks = one.page.get_by_label("Looks of the scene")
        drawn = "document.querySelector('#eyes canvas').toDataURL()"
        looks.select_option("plain")
        one.sees("trocar.scene.level === 'plain'")
        one.sees(f"{drawn}.length > 2000")
        plain = one.page.evaluate(drawn)
        looks.select_option("full")
        one.sees(f"{drawn} !== {plain!r}")
        one.context.close()
        assert one.errors == []


def test_smoke_rises_from_where_tissue_was_burnt_last(person):
    person.page.get_by_role("slider", name="Instant of the recording").fill("0.4")
    person.sees("Boolean(trocar.scene.surfaces[0].burnt)")
    seen = person.page.evaluate("""() => {
      const { scene } = trocar, { burnt } = scene.surfaces[0]
      for (let i = 0; i < 10; i++) scene.smokes(0, 0.004, i / 10)
      const many = scene.smoke.puffs.length
      const highest = Math.max(...scene.smoke.puffs.map(({ sprite }) => sprite.position.z))
      const near = scene.smoke.puffs.every(({ from }) => from.distanceTo(burnt) < 1e-6)
      for (let i = 10; i < 40; i++) scene.smokes(0, 0, i / 10)
      const left = scene.smoke.puffs.filter(({ sprite }) => sprite.visible).length
      scene.smokes(0, 0.004, 0)
      return { many, rises: highest > burnt.z + 0.01, near, left, anew: scene.smoke.puffs.length }
    }""")
    assert seen == {"many": 9, "rises": True, "near": True, "left": 0, "anew": 0}
    assert person.errors == []


def test_the_choice_is_kept_and_textures_are_loaded_once(person):
    person.page.get_by_label("Looks of the scene").select_option("simple")
    person.sees("trocar.scene.level === 'simple'")
    person.page.reload()
    person.sees("trocar.scene?.level === 'simple'")
    sizes = """
    performance.getEntriesByType("resource").filter(({ name }) => name.includes("/texture/"))
      .map(({ transferSize }) => transferSize)
    """
    loaded = person.page.evaluate(sizes)
    assert loaded
    assert set(loaded) == {0}, "from the browser's own store"
    assert person.errors == []


def test_less_is_drawn_where_pictures_take_too_long(person):
    person.sees("trocar.scene.quality.trials.plain > 0")
    climbed = person.page.evaluate("""async () => {
      const { quality } = trocar.scene, real = trocar.scene.trial
      const levels = []
      trocar.scene.trial = (level) => { levels.push(level); return 5 }
      await quality.choose("auto")
      const quick = [quality.found, quality.scene.level]
      for (let i = 0; i < 40; i++) quality.pace(90)
      await quality.apply()
      const slow = [quality.found, trocar.scene.level]
      trocar.scene.trial = () => 30
      await quality.choose("auto")
      trocar.scene.trial = real
      return { quick, slow, once: [quality.found, Object.keys(quality.trials)] }
    }""")
    assert climbed["quick"] == ["full", "full"]
    assert climbed["slow"] == ["plain", "plain"]
    assert climbed["once"] == ["plain", ["plain"]], "without a GPU no shader of higher looks is compiled"
    menu = person.page.get_by_label("Looks of the scene")
    assert menu.locator("option").first.inner_text() == "auto: plain"
    assert person.errors == []
