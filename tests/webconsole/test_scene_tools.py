"""Tools around the scene of the page: cameras, bodies, full-screen pictures, the handle on a tip, sliders."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from hub.planning.scenario_file import load
from hub.planning.session_parameters import SessionParameters
from robots import rotation
from schemas.files import Files
from tests.waiting import until
from tests.webconsole.conftest import served
from tests.webconsole.recorded_scene import write_scene
from tests.webconsole.test_browser import LED_ARM, Person, running
from webconsole.drag import dragged_tips
from webconsole.recorded import Recorded

OUTSIDE = """(() => {
  const { scene } = trocar, box = scene.robotBox().union(scene.surfaceBox()), out = []
  for (const x of ["min", "max"]) for (const y of ["min", "max"]) for (const z of ["min", "max"]) {
    const place = scene.camera.position.clone().set(box[x].x, box[y].y, box[z].z).project(scene.camera)
    if (Math.max(Math.abs(place.x), Math.abs(place.y)) > 1) out.push(place.toArray())
  }
  return out
})()"""
AROUND_A_WALL = """async () => {
  const THREE = await import("/web/vendor/three.module.js")
  const { clearestAzimuth } = await import("/web/clearest.js")
  const wall = new THREE.Mesh(new THREE.BoxGeometry(0.02, 0.4, 0.4))
  wall.position.set(0.1, 0, 0)
  wall.updateMatrixWorld()
  const work = new THREE.Box3().setFromCenterAndSize(new THREE.Vector3(), new THREE.Vector3(0.05, 0.05, 0.01))
  const usual = { distance: 0.5, elevation: 0.45, usual: 0 }, around = clearestAzimuth([wall], work, usual)
  wall.visible = false
  return [around, clearestAzimuth([wall], work, usual)]
}"""
CAMERA = "trocar.scene.camera.getWorldDirection(trocar.scene.camera.position.clone()).toArray()"
TIP = "trocar.scene.tips[0].axes.getWorldPosition(trocar.scene.tips[0].axes.position.clone()).toArray()"
UP_ARROW = """
() => {
  const { scene } = trocar, { camera, canvas } = scene, place = camera.position.clone()
  scene.tips[0].axes.getWorldPosition(place)
  // as three.js sizes it: the arrows are half as long as the handle's unit
  place.z += 0.4 * 0.7 / 4 * place.distanceTo(camera.position) * 1.9 * Math.tan((Math.PI * camera.fov) / 360)
  place.project(camera)
  const { left, top, width, height } = canvas.getBoundingClientRect()
  return [left + ((place.x + 1) / 2) * width, top + ((1 - place.y) / 2) * height]
}
"""
RING = """
() => {
  const { scene } = trocar, { camera, canvas } = scene, place = camera.position.clone()
  scene.tips[0].axes.getWorldPosition(place)
  const size = 1.1 / 4 * place.distanceTo(camera.position) * 1.9 * Math.tan((Math.PI * camera.fov) / 360)
  const near = camera.position.clone().sub(place), side = near.clone().set(-near.y, near.x, 0).normalize()
  near.setZ(0).normalize().add(side).normalize() // on the ring about z, where no other ring is
  place.addScaledVector(near, 0.5 * size).project(camera)
  const { left, top, width, height } = canvas.getBoundingClientRect()
  return [left + ((place.x + 1) / 2) * width, top + ((1 - place.y) / 2) * height]
}
"""
TURN = "trocar.scene.tips[0].axes.getWorldQuaternion(trocar.scene.tips[0].axes.quaternion.clone()).toArray()"
WIDE = """
[...document.querySelectorAll("body *")].filter((one) => one.checkVisibility() && !one.closest(".segments") &&
  one.getBoundingClientRect().right > innerWidth + 1).map((one) => one.outerHTML.slice(0, 120))
"""


@pytest.fixture(scope="module")
def served_scene(tmp_path_factory):
    directory = tmp_path_factory.mktemp("scene") / "palpation"
    write_scene(directory)
    with served(Recorded(directory)) as server:
        yield server


@pytest.fixture
def person(browser, served_scene):
    made = []

    def open_page(**context):
        link = f"http://127.0.0.1:{served_scene.port}{served_scene.gate.invite('operator')}"
        made.append(Person(browser, link, **context))
        made[-1].sees("Boolean(trocar.scene?.placed && trocar.scene.surfaces[0]?.mesh)")
        return made[-1]

    yield open_page
    for one in made:
        one.context.close()


def test_cameras_look_along_the_axes_and_the_room_is_the_scenarios(person):
    one = person()
    one.picture()
    home = one.page.evaluate(CAMERA)
    for name, way in (("Front", [0, 1, 0]), ("Side", [-1, 0, 0]), ("Top", [0, 0, -1])):
        one.page.get_by_role("radio", name=name).click()
        one.picture()
        assert one.page.evaluate(CAMERA) == pytest.approx(way, abs=0.03)
    one.page.get_by_role("radio", name="Work").click()
    one.picture()
    assert one.page.evaluate(CAMERA) == pytest.approx(home), "not from above, where the arm hides it"
    one.page.get_by_role("radio", name="Robot").click()
    one.picture()
    assert one.page.evaluate(OUTSIDE) == [], "all of the robot and what it works on is in the picture"
    one.page.get_by_role("radio", name="Top").click()
    one.page.keyboard.press("Tab")
    one.page.evaluate("trocar.scene.orbit.turn(0.1, 0)")
    assert one.page.get_by_role("radio", name="Top").get_attribute("aria-checked") == "false"
    one.page.evaluate(
        "trocar.scene.room = { position: [0, -1, 1], target: [0, 0, 0] }; trocar.scene.choose('overview')"
    )
    one.picture()
    assert one.page.evaluate("trocar.scene.camera.position.toArray()") == pytest.approx([0, -1, 1])
    assert one.page.get_by_role("radio", name="Overview").get_attribute("aria-checked") == "true"
    assert one.errors == []


def test_the_work_is_seen_from_where_the_arms_hide_least(person):
    around, usual = person().page.evaluate(AROUND_A_WALL)
    assert (around, usual) == (pytest.approx(np.pi / 2), 0.0)


def test_bodies_are_found_hidden_followed_and_told_by_keys(person):
    one = person()
    one.page.get_by_text("Bodies", exact=True).click()
    one.page.get_by_label("Filter the bodies").fill("block")
    names = (
        "[...document.querySelectorAll('.tree .line')].filter((e) => e.checkVisibility()).map((e) => e.text)"
    )
    assert one.page.evaluate(names) == ["soft", "tissue.block"]
    one.page.get_by_label("Filter the bodies").press("Tab")
    one.page.keyboard.press("ArrowDown")
    before = one.picture()
    one.page.keyboard.press("Space")
    assert one.page.evaluate("trocar.scene.surfaces[0].mesh.visible") is False
    assert one.picture() != before
    one.page.keyboard.press("Space")
    one.page.get_by_label("Filter the bodies").fill("")
    one.page.get_by_role("treeitem", name="PSM1", exact=True).focus()
    one.page.keyboard.press("ArrowRight")
    one.page.keyboard.press("ArrowDown")
    one.page.keyboard.press("f")
    pose = one.page.locator("#bodies .pose")
    pose.get_by_text("quaternion (x, y, z, w)").wait_for()
    followed = one.page.evaluate("trocar.scene.followed().toArray()")
    told = pose.inner_text().splitlines()[0].removeprefix("position ").removesuffix(" m").split(", ")
    assert [float(number) for number in told] == pytest.approx(followed, abs=1e-4)
    one.picture()
    assert one.page.evaluate("trocar.scene.orbit.target") == followed
    one.page.get_by_label("Frame of the pose").select_option("PSM1_base")
    until(lambda: pose.inner_text().splitlines()[0].split(", ") != told)
    assert one.errors == []


def test_a_picture_is_enlarged_to_the_whole_screen_and_back(person):
    one = person()
    picture = one.page.get_by_role("img", name="Picture of endoscope.left")
    picture.dblclick()
    one.sees("Boolean(document.fullscreenElement)")
    width = picture.bounding_box()["width"]
    assert width > 500
    picture.dblclick()
    one.sees("!document.fullscreenElement")
    one.page.evaluate("HTMLElement.prototype.requestFullscreen = undefined")  # as on a phone
    one.page.get_by_role("button", name="Full screen").first.click()
    one.sees("Boolean(document.querySelector('.enlarged'))")
    one.page.keyboard.press("Escape")
    one.sees("!document.querySelector('.enlarged')")
    assert one.errors == []


def test_nothing_is_wider_than_a_phone(person):
    one = person(has_touch=True)
    one.page.set_viewport_size({"width": 390, "height": 844})
    assert one.page.evaluate("document.documentElement.scrollWidth") <= 390
    assert one.page.evaluate(WIDE) == []
    view = one.page.locator("#view").bounding_box()
    assert (view["y"] < 200, view["width"]) == (True, 390), "the view is on top"
    assert one.page.locator("#plot-list").is_visible()
    one.page.get_by_role("button", name="Fold: Plots").tap()
    assert not one.page.locator("#plot-list").is_visible()
    assert one.errors == []


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    hub = tmp_path_factory.mktemp("hub")
    with running(hub, str(LED_ARM)) as session:
        yield session


def test_the_handle_leads_the_tip_while_it_is_held(browser, session):
    _, invite = session
    one = Person(browser, invite("operator"))
    one.sees("Boolean(trocar.scene?.placed)")
    one.page.get_by_role("button", name="Lead hand").click()
    one.sees("document.body.classList.contains('leading')")

    def find_tip():  # a busy machine may have led it out of the picture
        one.page.get_by_role("radio", name="PSM1").click()
        one.redraw()
        return one.page.evaluate(TIP)

    ways, turns = itertools.cycle((1, -1)), itertools.cycle((1, -1))

    def drag():  # again, the other way, where a busy machine lets go
        way = next(ways)
        start = find_tip()
        x, y = one.page.evaluate(UP_ARROW)
        one.page.mouse.move(x, y)
        one.page.wait_for_timeout(300)
        one.page.mouse.down()
        one.page.mouse.move(x, y - 40 * way, steps=5)
        one.page.wait_for_timeout(1000)
        ended = one.page.evaluate(TIP)
        one.page.mouse.up()
        return way * (ended[2] - start[2]) > 0.003 and ended[:2] == pytest.approx(start[:2], abs=1e-3)

    def turn():
        start, before = find_tip(), np.array(one.page.evaluate(TURN))
        x, y = one.page.evaluate(RING)
        one.page.mouse.move(x, y)
        one.page.wait_for_timeout(300)
        one.page.mouse.down()
        one.page.mouse.move(x + 60 * next(turns), y, steps=5)
        one.page.wait_for_timeout(1000)
        ended, after = one.page.evaluate(TIP), np.array(one.page.evaluate(TURN))
        one.page.mouse.up()
        about = rotation.log(rotation.product(after, rotation.conjugate(before)))  # in the world, rad
        still = ended == pytest.approx(start, abs=2e-3)
        return still and abs(about[2]) > 0.1 and np.abs(about[:2]).max() < 0.3 * abs(about[2])

    until(drag)
    until(turn)
    one.page.get_by_text("holding").wait_for()
    assert one.errors == []
    one.context.close()


def test_a_slider_changes_gravity_and_says_so(browser, session):
    _, invite = session
    one = Person(browser, invite("operator"))
    one.page.get_by_text("Parameters that may change now").click()
    one.page.get_by_role("slider", name="robot.gravity").fill("3")
    one.page.locator("#lines").get_by_text("gravity: 9.81 to 3 m/s^2").wait_for()
    one.page.get_by_role("button", name="robot.gravity: back").click()
    one.page.locator("#lines").get_by_text("gravity: 3 to 9.81 m/s^2").wait_for()
    one.page.get_by_role("slider", name="Light of the scene").fill("2")
    one.sees("trocar.scene.lights.brightness === 2")
    viewer = Person(browser, invite("viewer"))
    viewer.sees("Boolean(trocar.session)")
    viewer.page.get_by_text("Parameters that may change now").click()
    assert not viewer.page.get_by_role("slider", name="robot.gravity").is_visible()
    for page in (one, viewer):
        assert page.errors == []
        page.context.close()


def test_it_is_said_why_no_tip_can_be_dragged():
    def of(name, *changes):
        file = load(name, changes)
        params = SessionParameters.of_scenario(file.scenario, Files(Path.cwd()))
        tips, reasons = dragged_tips(file.scenario, params.validate_last)
        return json.dumps([tip._asdict() for tip in tips]), reasons

    right, left = (
        {"device": name, "arm": arm, "view": "camera", "turns": True}
        for name, arm in (("right", "PSM1"), ("left", "PSM2"))
    )
    assert of("browser") == (json.dumps([right, left]), ())
    tips, (reason,) = of("browser", "participants.right_hand.engage=released")
    assert (tips, "engage: held" in reason) == (json.dumps([left]), True)
    tips, (reason,) = of("palpation")
    assert (tips, "no device of this session is led from a page" in reason) == ("[]", True)
