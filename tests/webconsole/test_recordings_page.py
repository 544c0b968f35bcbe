"""The list of recordings in a real browser: opening one, and comparing two."""

import os

import av
import numpy as np
import pytest
from PIL import Image

from tests.webconsole.conftest import served
from tests.webconsole.recorded_scene import write_scene
from tests.webconsole.test_browser import NAMELESS, Person
from webconsole.recorded import Recorded

OWN_TIP = "trocar.scene.tips[0].axes.parent.position.z"
OTHER_TIP = (
    "trocar.comparison.ghost.bodies[0][trocar.scene.bodies[0].indexOf(trocar.scene.tips[0].axes.parent)]"
    ".position.z"
)


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    home = tmp_path_factory.mktemp("recordings")
    write_scene(home / "first")
    write_scene(home / "second", 90)
    (home / "broken.mcap").write_bytes(b"no recording")
    with served(Recorded(home / "first"), home=home) as server:
        yield server


@pytest.fixture
def person(browser, server):
    made = []

    def open_page(role="operator", **context):
        link = f"http://127.0.0.1:{server.port}{server.gate.invite(role)}"
        made.append(Person(browser, link, **context))
        made[-1].sees("Boolean(window.trocar?.scene?.placed)")
        return made[-1]

    yield open_page
    for one in made:
        one.context.close()


def test_a_recording_of_the_list_is_opened_and_the_first_one_again(person):
    one = person()
    one.page.get_by_role("button", name="Recordings").click()
    dialog = one.page.get_by_role("dialog", name="Recordings")
    dialog.get_by_role("row", name="second").wait_for()
    assert "shown" in dialog.get_by_role("row", name="first").inner_text()
    assert "is not an MCAP file" in dialog.get_by_role("row", name="broken").inner_text()
    assert dialog.get_by_role("link", name="broken").count() == 0
    assert one.page.evaluate(NAMELESS) == []
    dialog.get_by_label("Find in the list").fill("sec pal")
    assert not dialog.get_by_role("row", name="first").is_visible()
    dialog.get_by_role("link", name="second", exact=True).click()
    one.page.wait_for_url("**/?recording=second*")
    one.sees("window.trocar?.scene?.placed && Number(document.querySelector('#scrub').max) > 1.4")
    one.page.get_by_role("link", name="Back to the first").click()
    one.sees("window.trocar?.scene?.placed && Number(document.querySelector('#scrub').max) < 1")
    assert one.errors == []


def test_a_viewer_has_no_list(person):
    one = person("viewer")
    assert not one.page.get_by_role("button", name="Recordings").is_visible()


def test_two_recordings_are_compared_on_one_timeline(person):
    """The second one is longer, and its arm has gone down further at its end."""
    one = person()
    one.page.get_by_role("button", name="Recordings").click()
    row = one.page.get_by_role("row", name="second")
    row.get_by_role("link", name="Compare").click()
    one.page.wait_for_url("**/?compare=second*")
    table = one.page.get_by_label("Two recordings").get_by_role("table")
    table.wait_for()
    assert table.get_by_role("row").first.inner_text().split() == ["first", "second", "difference"]
    duration = table.get_by_role("row", name="duration")
    assert duration.inner_text().split() == ["duration", "(s)", "0.96", "1.44", "+0.48"]

    one.sees("window.trocar?.scene?.placed && trocar.comparison?.ghost?.surfaces[0]?.mesh")
    slider = one.page.get_by_role("slider", name="Instant of the recording")
    assert slider.get_attribute("max") == "1.44", "until the end of the longer one"
    slider.fill("0.4")
    one.sees(f"trocar.time === 0.4 && {OTHER_TIP} === {OWN_TIP}")
    slider.fill("1.44")
    one.sees(f"Math.abs({OTHER_TIP} - {OWN_TIP}) > 0.02")
    one.sees("document.querySelectorAll('.plot i.dashed').length > 0")
    theirs = one.page.locator("#lines li.other")
    theirs.get_by_text("contact, 0.05 N").wait_for()
    assert theirs.locator("span").nth(1).inner_text().startswith("second: ")
    times = one.page.locator("#lines li span:first-child").all_inner_texts()
    assert len(times) == 2 * theirs.count()
    assert times == sorted(times, key=lambda text: float(text.split()[0]))
    one.page.get_by_label("ghost in the scene").uncheck()
    one.sees("!trocar.comparison.world.visible")
    assert one.page.evaluate(NAMELESS) == []
    one.page.get_by_role("link", name="End comparison").click()
    one.sees("window.trocar?.scene?.placed && Number(document.querySelector('#scrub').max) < 1")
    assert one.errors == []


def test_the_log_follows_the_instant_and_can_be_filtered_and_resized(person):
    one = person()
    first = one.page.locator("#lines li").first
    first.get_by_text("contact, 0.05 N").wait_for()
    slider = one.page.get_by_role("slider", name="Instant of the recording")
    slider.fill("0.05")
    one.sees("document.querySelector('#lines li').className === 'info later'")
    slider.fill("0.5")
    one.sees("document.querySelector('#lines .current')?.textContent.includes('contact, 0.05 N')")
    one.page.get_by_label("Levels in the log").select_option("errors")
    assert not first.is_visible()
    one.page.get_by_label("Levels in the log").select_option("all")
    one.page.get_by_label("Participant in the log").select_option("tissue")
    one.page.get_by_label("Find in the log").fill("Contact")
    assert first.is_visible()
    one.page.get_by_label("Find in the log").fill("grasp")
    assert not first.is_visible()
    edge, height = one.page.get_by_label("Height of the log"), "document.querySelector('#lines').clientHeight"
    before = one.page.evaluate(height)
    edge.focus()
    one.page.keyboard.press("ArrowUp")
    assert one.page.evaluate(height) == before + 17
    box = edge.bounding_box()
    one.page.mouse.move(box["x"] + 300, box["y"] + 3)
    one.page.mouse.down()
    one.page.mouse.move(box["x"] + 300, box["y"] - 97, steps=4)
    one.page.mouse.up()
    assert one.page.evaluate(height) == pytest.approx(before + 117, abs=2)
    one.page.reload()
    one.sees(f"{height} > {before} + 100")
    assert one.errors == []


NOTE_WHETHER_IT_CAN_BE_ENDED = """
window.canBeEnded = false
new MutationObserver(() => {
  window.canBeEnded ||= [...document.querySelectorAll("button")].some((one) => one.textContent === "End film")
}).observe(document.body, { subtree: true, childList: true })
"""
KEEP_THE_LAST_TIME = """
() => {
  const { prototype } = CanvasRenderingContext2D, { fillText } = prototype
  prototype.fillText = function (...words) {
    fillText.apply(this, words)
    if (!/^[0-9.]+ s$/.test(words[0])) return  // numbers of a plot
    const { width, height } = this.canvas
    window.lastTime = Array.from(this.getImageData(width - 240, height - 60, 240, 60).data)
  }
}
"""


def test_a_picture_and_a_film_of_the_scene_are_saved(person, tmp_path):
    """The picture has every pixel of the screen, and the film ends with the recording."""
    one = person(device_scale_factor=2)
    one.page.get_by_role("slider", name="Instant of the recording").fill("0.5")
    one.sees("trocar.framed === 0.5")
    with one.page.expect_download() as saved:
        one.page.get_by_role("button", name="Picture").click()
    assert saved.value.suggested_filename == "palpation-0.500s.png"
    saved.value.save_as(tmp_path / "scene.png")
    size = one.page.evaluate("[trocar.scene.canvas.clientWidth, trocar.scene.canvas.clientHeight]")
    with Image.open(tmp_path / "scene.png") as picture:
        assert picture.size == (2 * size[0], 2 * size[1])
        assert len(picture.convert("RGB").resize((64, 64)).getcolors(4096)) > 100
    one.page.get_by_label("Speed").select_option("0.1×")
    one.page.evaluate(KEEP_THE_LAST_TIME)
    one.page.evaluate(NOTE_WHETHER_IT_CAN_BE_ENDED)
    with one.page.expect_download() as saved:
        one.page.get_by_role("button", name="Film").click()
    assert one.page.evaluate("canBeEnded")
    assert saved.value.suggested_filename.startswith("palpation-0.500s-0.960s.")
    saved.value.save_as(tmp_path / "film")
    with av.open(str(tmp_path / "film")) as film:
        pictures = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert pictures[0].shape[1] == size[0] * 2
    if place := os.environ.get("TROCAR_SCREENSHOTS"):
        Image.fromarray(pictures[-1]).save(f"{place}/film.png")
    assert len(pictures) > 2
    drawn = np.array(one.page.evaluate("lastTime")).reshape(60, 240, 4)[:, :, :3]
    wrong = [(np.abs(picture[-60:, -240:] - drawn).max(axis=2) > 100).sum() for picture in pictures]
    assert wrong[-1] < 10 < wrong[0], "the last picture shows the last instant"
    one.page.get_by_role("button", name="Film").wait_for()
    assert one.errors == []
