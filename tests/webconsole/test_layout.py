"""The page on a laptop of 13 inches and on a tablet, light and dark, and by keys alone."""

import lzma
import os
from pathlib import Path

import pytest

from tests.webconsole.conftest import served
from tests.webconsole.recorded_scene import write_scene
from tests.webconsole.test_browser import NAMELESS, Person
from webconsole.recorded import Recorded

OLD = Path(__file__).parents[1] / "hub" / "recording" / "recordings_0_1_0"
OUTSIDE = """
[...document.querySelectorAll("button, input, select, canvas, dialog")].filter((e) => {
  const box = e.getBoundingClientRect()
  return e.checkVisibility() && (box.left < -1 || box.right > innerWidth + 1)
}).map((e) => e.outerHTML)
"""


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    directory = tmp_path_factory.mktemp("layout") / "palpation"
    write_scene(directory)
    with served(Recorded(directory)) as server:
        yield server


@pytest.fixture
def opened(browser, server):
    made = []

    def open_page(width, height, theme):
        link = f"http://127.0.0.1:{server.port}{server.gate.invite('operator')}"
        made.append(Person(browser, link, color_scheme=theme))
        made[-1].page.set_viewport_size({"width": width, "height": height})
        made[-1].sees("Boolean(trocar.scene?.placed)")
        return made[-1]

    yield open_page
    for one in made:
        one.context.close()


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize(("width", "height"), [(1280, 800), (820, 1180)], ids=["laptop", "tablet"])
def test_everything_is_within_the_window_and_has_a_name(opened, width, height, theme):
    one = opened(width, height, theme)
    ground = one.page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (sum(map(int, ground[4:-1].split(","))) < 200) == (theme == "dark")
    for dialog in ("Fork here", "New session"):
        one.page.get_by_role("button", name=dialog).click()
        one.page.get_by_role("dialog").wait_for()
        if dialog == "New session":
            one.page.locator("#start-fields summary").first.wait_for()
        assert one.page.evaluate(OUTSIDE) == []
        assert one.page.evaluate(NAMELESS) == []
        if place := os.environ.get("TROCAR_SCREENSHOTS"):
            one.page.screenshot(path=f"{place}/{dialog}-{width}-{theme}.png")
        one.page.keyboard.press("Escape")
    assert one.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert one.errors == []


@pytest.mark.parametrize("width", [1280, 960, 400])
def test_warnings_cover_no_button(opened, width):
    one = opened(width, 700, "light")
    covered = one.page.evaluate(
        """async () => {
          const { Alerts } = await import("/web/alerts.js")
          const text = "no page leads: choose 'Lead right' on the page of `trocar view`"
          new Alerts(document.getElementById("alerts")).add(
            ["right", "left", "third"].map((source) => ({ time: 0, level: "warn", source, text })))
          return [...document.querySelectorAll(".tools button, .tools input, .tools select, .lead button")]
            .filter((one) => one.checkVisibility() && inView(one) && !one.contains(at(one)))
            .map((one) => one.outerHTML)
          function inView(one) {
            const box = one.getBoundingClientRect(), row = one.parentElement.getBoundingClientRect()
            return box.right <= row.right + 1 && box.left >= row.left - 1 // the row of cameras may scroll
          }
          function at(one) {
            const { x, y, width, height } = one.getBoundingClientRect()
            return document.elementFromPoint(x + width / 2, y + height / 2)
          }
        }"""
    )
    assert covered == []


def test_keys_alone_reach_what_is_needed(opened):
    one = opened(1280, 800, "light")
    one.page.locator("body").click(position={"x": 5, "y": 790})
    wanted = {"new", "canvas", "Robot", "frames", "add", "play", "scrub", "speed", "fork-here", "lines"}
    reached = set()
    for _ in range(40):
        one.page.keyboard.press("Tab")
        reached.add(one.page.evaluate("document.activeElement.id || document.activeElement.textContent"))
    assert wanted <= reached
    one.page.locator("#scrub").focus()
    one.page.keyboard.press("End")
    one.sees("trocar.time > 0.9")
    one.page.locator("#new").focus()
    one.page.keyboard.press("Enter")
    one.page.get_by_role("dialog", name="New session").wait_for()


def test_a_recording_of_an_older_version_is_shown(browser, tmp_path):
    file = tmp_path / "old.mcap"
    file.write_bytes(lzma.decompress((OLD / "palpation.mcap.xz").read_bytes()))
    with served(Recorded(file)) as server:
        one = Person(browser, f"http://127.0.0.1:{server.port}{server.gate.invite('viewer')}")
        one.sees("document.querySelectorAll('.plot').length > 0")
        assert one.page.evaluate("Number(document.querySelector('#scrub').max)") > 0
        assert one.errors == []
        one.context.close()
