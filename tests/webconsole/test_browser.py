"""The page in a real browser: what it draws, says and sends."""

import asyncio
import json
import os
import re
import signal
import struct
import subprocess
import sys
from contextlib import AsyncExitStack, contextmanager
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from websockets.asyncio.client import connect

from hub.recording.bond_trace import read_bond_trace
from hub.recording.recording import Recording
from tests.waiting import until
from tests.webconsole.conftest import CHROMIUM, cookie_of, finish, served
from tests.webconsole.recorded_scene import EYES, write_scene
from webconsole.frame import sections
from webconsole.listening import on_loopback
from webconsole.live import Live
from webconsole.recorded import Recorded

LED_ARM = Path(__file__).parent / "led_arm.yaml"
LED = [{"device": "hand", "pilot": "you"}]
TIP = "trocar.scene.tips[0].axes.parent.position.toArray()"
GAMEPAD = """
let pressed = 0
window.press = (value) => { pressed = value }
const button = (i) => ({ value: i === 4 ? Math.abs(pressed) : 0 })
navigator.getGamepads = () => [{
  connected: true, mapping: "standard", axes: [0, pressed, 0, 0],
  buttons: Array.from({ length: 17 }, (_, i) => button(i)),
}]
"""
NAMELESS = """
[...document.querySelectorAll("button, input, select, canvas")].filter((e) =>
  e.checkVisibility() && !e.ariaHidden && !(e.ariaLabel || e.textContent.trim() || e.labels?.length)
).map((e) => e.outerHTML)
"""


class Person:
    """Somebody who looks at the page."""

    def __init__(self, browser, url, *scripts, **context):
        self.context = browser.new_context(viewport={"width": 1100, "height": 700}, **context)
        for script in scripts:
            self.context.add_init_script(script)
        self.context.set_default_timeout(60_000)
        self.page = self.context.new_page()
        self.errors, self.requested = [], []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda said: self.errors.append(said.text) if said.type == "error" else None)
        self.page.on("request", lambda request: self.requested.append(request.url))
        self.page.goto(url)

    def sees(self, expression):
        """Wait until an expression of the page is true, and return it."""
        return until(lambda: self.page.evaluate(expression))

    def redraw(self):
        drawn = self.page.evaluate("trocar.drawn")
        self.page.evaluate("trocar.scene.dirty()")
        self.sees(f"trocar.drawn > {drawn}")

    def picture(self):
        """Return the pixels of the scene, once they have been drawn."""
        self.redraw()
        return self.page.locator("#canvas").screenshot()


@pytest.fixture(scope="module")
def served_scene(tmp_path_factory):
    directory = tmp_path_factory.mktemp("scene") / "palpation"
    write_scene(directory)
    with served(Recorded(directory)) as server:
        yield server


@pytest.fixture
def person(browser, served_scene):
    made = []

    def open_page(*scripts, **context):
        link = f"http://127.0.0.1:{served_scene.port}{served_scene.gate.invite('operator')}"
        made.append(Person(browser, link, *scripts, **context))
        return made[-1]

    yield open_page
    for one in made:
        one.context.close()


def test_a_recording_is_shown(person, served_scene):
    one = person()
    one.sees("Boolean(trocar.scene?.placed && trocar.scene.surfaces[0]?.mesh)")
    first, start = one.picture(), one.page.evaluate(TIP)
    one.page.get_by_role("slider", name="Instant of the recording").fill("0.8")
    one.sees("trocar.time === 0.8")
    one.sees(f"Math.abs({TIP}[2] - {start[2]} + 0.045) < 1e-6")
    assert one.picture() != first, "the arm and the organ have moved"
    assert "t=0.800" in until(lambda: "t=0.800" in one.page.url and one.page.url)
    one.page.get_by_role("radio", name="Robot").click()
    assert one.page.get_by_role("radio", name="Robot").get_attribute("aria-checked") == "true"

    one.page.get_by_role("button", name="Event before").click()
    assert one.page.locator("#instant").inner_text() == "0.096 s", "the first contact"
    assert "contact, 0.05 N" in one.page.locator("#lines").inner_text()
    one.page.locator("#canvas").focus()
    one.page.keyboard.press("Space")
    one.sees("trocar.time > 0.15")
    one.page.keyboard.press("Space")

    one.page.get_by_label("Add a port").fill("robot.qpos")
    one.page.get_by_label("Add a port").press("Enter")
    one.sees("document.querySelectorAll('.plot').length === 3")
    assert one.page.get_by_text("robot.qpos").is_visible()
    assert {re.sub(r"(:\d+)/.*", r"\1", url) for url in one.requested} == {
        f"http://127.0.0.1:{served_scene.port}"
    }
    assert one.errors == []
    assert one.page.evaluate(NAMELESS) == []


def test_both_eyes_are_one_picture_for_red_and_cyan_glasses(person):
    one = person()
    one.page.get_by_role("img", name="Picture of endoscope.right").wait_for()
    one.page.get_by_label("How both eyes are shown").select_option("red and cyan")
    both = one.page.get_by_role("img", name="red and cyan glasses")
    both.wait_for()
    pixel = "e => [...e.getContext('2d').getImageData(e.width - 1, e.height - 1, 1, 1).data]"
    red, green, blue = EYES["left"][0], *EYES["right"][1:]
    until(lambda: both.evaluate(pixel) == [red, green, blue, 255])
    assert not one.page.get_by_role("img", name="Picture of endoscope.left").is_visible()
    assert one.errors == []


PRESSED = """
async () => {
  const { contactsOf } = await import("/web/depth.js")
  return (await contactsOf("robot.PSM1/probe")).map((line) => line.at(-1))
}
"""
MARKED = """
shape => {
  const box = trocar.scene.robotBox().makeEmpty()
  for (const one of trocar.scene.markers.shown[0]) if (one.geometry.type === shape) box.expandByObject(one)
  return [box.min.toArray(), box.max.toArray()]
}
"""


def pink(picture):
    """Return how many pixels have about the colour of the markers."""
    red, green, blue = np.moveaxis(np.asarray(Image.open(BytesIO(picture)).convert("RGB"), int), 2, 0)
    return int(((red > 100) & (blue > 100) & (green < 0.4 * red)).sum())


def test_markers_are_in_the_scene_and_words_of_the_camera_on_the_page(person):
    one = person()
    one.sees("Boolean(trocar.scene?.placed && trocar.scene.surfaces[0]?.mesh)")
    one.page.get_by_role("slider", name="Instant of the recording").fill("0.1")
    one.page.get_by_text("Insert the needle").wait_for()
    kinds = one.page.evaluate(
        "trocar.scene.markers.shown[0].map(({ geometry, type }) => geometry.type + type)"
    )
    assert {"ConeGeometryMesh", "CylinderGeometryMesh", "BufferGeometryMesh", "BufferGeometrySprite"} < {
        *kinds
    }
    low, high = one.page.evaluate(MARKED, "SphereGeometry")  # SPHERE and, behind it and above, SPHERE_LIST
    assert low == pytest.approx([0.0435, -0.0225, -0.0025])
    assert high == pytest.approx([0.060, -0.0175, 0.014])
    assert pink(one.picture()) > 3000
    one.page.get_by_role("slider", name="Instant of the recording").fill("0.8")
    one.sees("trocar.scene.markers.shown[0].length === 0")
    assert not one.page.locator("#notice").is_visible()
    assert pink(one.picture()) == 0
    assert one.errors == []


def test_the_instant_is_in_the_link(person):
    one = person()
    one.sees("Boolean(trocar.session)")
    one.page.evaluate("location.hash = 't=0.5'")
    one.sees("trocar.time === 0.5")
    one.page.reload()
    one.sees("trocar.time === 0.5")


def test_without_opengl_the_rest_works_and_it_says_why(browser, served_scene):
    flags = ["--no-sandbox", "--disable-gpu", "--disable-3d-apis"]
    plain = browser.browser_type.launch(executable_path=CHROMIUM, args=flags)
    link = f"http://127.0.0.1:{served_scene.port}{served_scene.gate.invite('operator')}"
    one = Person(plain, link, color_scheme="dark")
    text = one.page.locator("#no-scene")
    text.wait_for(state="visible")
    assert "draws no scene" in text.inner_text()
    one.page.get_by_role("slider", name="Instant of the recording").fill("0.3")
    one.sees("document.querySelector('#instant').textContent === '0.300 s'")
    one.sees("document.querySelectorAll('.plot').length > 0")
    red = "document.querySelector('#pictures-row canvas').getContext('2d').getImageData(0, 0, 1, 1).data[0]"
    one.sees(f"{red} === {EYES['left'][0]}")
    one.page.get_by_text("Insert the needle").wait_for()
    plain.close()


def test_a_server_that_was_started_again_says_that_its_link_is_needed(browser, tmp_path):
    write_scene(tmp_path / "scene", 4)
    with served(Recorded(tmp_path / "scene")) as server:
        one = Person(browser, f"http://127.0.0.1:{server.port}{server.gate.invite('operator')}")
        one.sees("Boolean(trocar.session)")
    banner = one.page.get_by_role("alert").first
    banner.get_by_text("does not answer").wait_for()
    with served(Recorded(tmp_path / "scene"), listening=on_loopback(server.port)) as again:
        banner.get_by_text("Open the link that it has printed").wait_for()
        one.page.goto(f"http://127.0.0.1:{again.port}{again.gate.invite('operator')}")
        one.sees("Boolean(trocar.session)")
        one.context.close()


def test_a_hub_that_is_gone_is_said_and_its_successor_is_shown(browser, tmp_path):
    file = tmp_path / "gone.yaml"
    file.write_text(
        "name: gone\nstep: 5 ms\npace: realtime\nscene: {arms: {PSM1: {instrument: palpation-probe}}}\n"
        "participants: {robot: {kind: mujoco, looks: false}}\n"
    )
    command = [sys.executable, "-P", "-m", "trocar", "run", str(file)]
    live, quiet = Live(session="gone"), subprocess.DEVNULL
    live.start()
    with served(live) as server:
        one = Person(browser, f"http://127.0.0.1:{server.port}{server.gate.invite('viewer')}")
        for _ in range(2):
            one.page.get_by_text("The page comes back by itself").wait_for()
            with subprocess.Popen(command, stdout=quiet, stderr=quiet) as hub:
                try:
                    one.sees("document.querySelector('#state').textContent === 'running'")
                    one.sees("Boolean(trocar.scene?.placed) && document.querySelector('#banner').hidden")
                finally:
                    hub.kill()
        one.page.get_by_text("'gone' is over, or its hub is gone").wait_for()
        assert one.errors == []
        one.context.close()


def inviter(link):
    """Return what makes links of a server, by the first one that it has printed."""
    host, path = re.fullmatch(r"http://([^/]+)(/.*)", link).groups()
    cookie = cookie_of(host, path)

    async def invite(role):
        headers = {"Cookie": cookie, "Origin": f"http://{host}"}
        async with connect(f"ws://{host}/page", additional_headers=headers, origin=None) as socket:
            await socket.send(json.dumps({"do": "invite", "role": role}))
            answer = {}
            while "path" not in answer:
                message = await socket.recv()
                answer = json.loads(message) if isinstance(message, str) else {}
            return f"http://{host}{answer['path']}"

    return lambda role: finish(invite(role))


@contextmanager
def running(hub, *arguments):
    """Run a session with its page; yield its process, and what makes links to the page."""
    command = [sys.executable, "-P", "-m", "trocar", "run", "--open", *arguments]
    said = hub / "said.txt"
    with (
        said.open("w") as out,
        subprocess.Popen(
            command, stdout=out, stderr=out, env=os.environ | {"BROWSER": "true", "TMPDIR": str(hub)}
        ) as run,
    ):
        try:
            link = until(
                lambda: run.poll() is not None or re.search(r"http://127\S+", said.read_text()), 60.0
            )
            if run.poll() is not None:
                pytest.fail(said.read_text())
            yield run, inviter(link[0])
        finally:
            run.send_signal(signal.SIGINT)


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """A running session that a page can lead, and what makes links to its page."""
    hub = tmp_path_factory.mktemp("hub")
    with running(hub, str(LED_ARM), "--record", str(hub / "recorded")) as session:
        yield session


def test_a_page_leads_an_arm_and_lets_go(browser, session):
    """Keys, then the loss of the focus; a gamepad; pause; a second page; and a page that stands still."""
    run, invite = session
    one = Person(browser, invite("operator"), GAMEPAD)
    one.sees("Boolean(trocar.scene?.placed)")
    one.page.get_by_role("button", name="Lead hand").click()
    one.page.get_by_text("you lead it").wait_for()
    one.page.get_by_text("holding: press space, and hold it, to move").wait_for()
    start = one.page.evaluate(TIP)

    silent = one.page.locator("#dead-man", has_text="let go of")  # as page or arm were silent for too long

    def moves(from_, press):
        """Press, and press again when the page asks for it, until the tip has moved by 4 mm."""

        def moved():
            if silent.is_visible():  # a busy machine held the page up for longer than the device allows
                press(False)
                press(True)
            return one.page.evaluate(f"Math.hypot(...{TIP}.map((x, i) => x - {from_}[i])) > 0.004")

        press(True)
        until(moved)

    def press_space(down):
        (one.page.keyboard.down if down else one.page.keyboard.up)("Space")

    def press_gamepad(down):
        one.page.evaluate(f"press({-1 if down else 0})")
        one.page.wait_for_timeout(100)  # a gamepad is read once a frame

    one.page.keyboard.down("s")
    moves(start, press_space)
    one.page.get_by_text("moving: dead-man held").wait_for()
    one.page.evaluate("window.dispatchEvent(new Event('blur'))")
    one.page.get_by_text("holding: press space, and hold it, to move").wait_for()
    one.page.keyboard.up("s")
    one.page.keyboard.up("Space")
    place = still(one)
    moves(place, press_gamepad)
    press_gamepad(False)
    place = still(one)
    pad = one.page.locator("#pad").bounding_box()

    def press_pointer(down):
        if down:
            one.page.mouse.move(pad["x"] + 60, pad["y"] + 45)
            one.page.mouse.down()
            one.page.mouse.move(pad["x"] + 60, pad["y"] + 5, steps=8)
        else:
            one.page.mouse.up()

    moves(place, press_pointer)
    press_pointer(False)
    still(one)

    one.page.get_by_role("button", name="Share").click()
    shared = until(lambda: re.search(r"http://127\S+token=\S+", one.page.locator("#lines").inner_text()))
    other = Person(browser, shared[0])
    other.sees("trocar.session?.role === 'viewer' && Boolean(trocar.scene?.placed)")
    assert not other.page.get_by_role("button", name="Lead hand").is_visible()
    assert not other.page.get_by_role("button", name="Pause").is_visible()

    second = Person(browser, invite("operator"))
    second.page.get_by_text(re.compile(r"page \d+ leads it")).wait_for()
    assert second.page.get_by_role("button", name="Lead hand").is_disabled()
    second.context.close()

    one.page.get_by_role("button", name="Pause").click()
    one.page.get_by_text("holding: the session is paused; press Resume").wait_for()
    one.page.get_by_role("button", name="Resume").click()
    one.sees("document.querySelector('#state').textContent === 'running'")
    one.page.evaluate("press(-1)")
    one.page.get_by_text("moving: dead-man held").wait_for()
    one.context.close()  # as a browser that dies: its page leads no more, and the arm holds
    other.sees("document.querySelector('#lines').textContent.includes('no page leads')")
    still(other)
    other.context.close()
    assert run.poll() is None


def connect_over_cdp(browser, address):
    """Return the browser at an address; None if it does not answer: one that still starts may never do."""
    from playwright.sync_api import TimeoutError as Silence

    try:
        return browser.browser_type.connect_over_cdp(address, timeout=15_000)
    except Silence:
        return None


@contextmanager
def own_browser(browser, directory):
    """Yield a browser in processes of its own, and what sends signals to all of them."""
    flags = ["--no-sandbox", "--headless", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    place = [f"--user-data-dir={directory}", "--remote-debugging-port=0"]
    nothing = subprocess.DEVNULL
    with subprocess.Popen(
        [CHROMIUM, *flags, *place], stdout=nothing, stderr=nothing, start_new_session=True
    ) as process:
        try:
            port = directory / "DevToolsActivePort"
            until(lambda: port.exists() and port.read_text())
            address = f"http://127.0.0.1:{port.read_text().split()[0]}"
            own = until(lambda: connect_over_cdp(browser, address))
            yield own, lambda one: os.killpg(process.pid, one)
        finally:
            os.killpg(process.pid, signal.SIGKILL)


def test_a_browser_that_stands_still_or_is_killed_lets_the_arm_hold(browser, session, tmp_path):
    """With a key held down all the time; meanwhile the session and another page go on."""
    run, invite = session
    other = Person(browser, invite("viewer"))
    other.sees("Boolean(trocar.scene?.placed)")
    with own_browser(browser, tmp_path / "own") as (own, send):
        one = Person(own, invite("operator"))
        one.sees("Boolean(trocar.scene?.placed)")
        one.page.get_by_role("button", name="Lead hand").click()
        one.page.get_by_text("you lead it").wait_for()

        def press():
            before = other.page.evaluate(TIP)

            def moves():  # pressed anew each time: on a busy machine 100 ms of silence let go meanwhile
                for key in ("w", "Space"):
                    one.page.keyboard.up(key)
                for key in ("Space", "w"):
                    one.page.keyboard.down(key)
                other.page.wait_for_timeout(500)
                return other.page.evaluate(f"Math.hypot(...{TIP}.map((x, i) => x - {before}[i])) > 0.002")

            until(moves)

        press()
        send(signal.SIGSTOP)
        place, time = still(other), other.page.evaluate("trocar.time")
        other.sees(f"trocar.time > {time + 1}")
        send(signal.SIGCONT)
        other.page.wait_for_timeout(500)
        assert np.allclose(other.page.evaluate(TIP), place, atol=2e-4), "the key has to be pressed anew"
        one.page.get_by_text("let go of space, and press it again").wait_for()
        one.page.keyboard.up("w")
        one.page.keyboard.up("Space")
        one.page.get_by_role("button", name="Leave hand").wait_for()
        press()
        said = "document.querySelector('#lines').textContent.split('no page leads').length"
        count = other.page.evaluate(said)
        send(signal.SIGKILL)
        other.sees(f"{said} > {count}")
        still(other)
    other.context.close()
    assert run.poll() is None


def test_sliders_change_the_network_of_a_device(browser, session):
    _, invite = session
    one = Person(browser, invite("operator"))
    one.page.get_by_text("Network of the devices").click()
    delay = one.page.get_by_role("slider", name="delay of hand, ms")
    delay.fill("100")
    one.page.locator("#links").get_by_text("100 ms each way").wait_for()
    assert "network link: 100 ms each way" in one.page.locator("#lines").inner_text()
    delay.fill("0")
    one.page.get_by_text("no emulated network").wait_for()
    assert one.errors == []
    one.context.close()


def test_the_past_of_the_running_session_is_shown_until_live_is_chosen(browser, session):
    _, invite = session
    one = Person(browser, invite("viewer"))
    one.sees("Boolean(trocar.scene?.placed)")
    slider = one.page.get_by_role("slider", name="Instant")
    one.sees("Number(document.querySelector('#scrub').max) > 1.5")
    slider.fill("0.5")
    one.sees("trocar.framed === 0.5")
    one.page.get_by_text("past: 0.500 s").wait_for()
    place = still(one)
    one.page.get_by_role("button", name="Play").click()
    one.sees("trocar.time > 0.7")
    one.page.get_by_role("button", name="Pause", exact=True).click()
    slider.fill("0.5")
    one.sees("trocar.framed === 0.5")
    assert still(one) == place, "each instant is shown exactly again"
    one.page.get_by_role("button", name="Live").click()
    one.sees("trocar.time > 2 && !document.body.classList.contains('past')")
    time = one.page.evaluate("trocar.time")
    one.sees(f"trocar.time > {time} + 0.5")
    assert one.errors == []
    one.context.close()


class Looker:
    """A page without a browser: it acknowledges each frame, and keeps what it gets."""

    def __init__(self, socket):
        self.socket, self.times, self.state, self.errors = socket, [], {"pilots": []}, []

    async def read(self):
        async for message in self.socket:
            if isinstance(message, bytes):
                number, time_ns, _ = sections(message)
                await self.socket.send(struct.pack("<I", number))
                self.times.append(time_ns)
                continue
            content = json.loads(message)
            if content["is"] == "state":
                self.state = content
            self.errors += [content["error"]] if "error" in content else []

    async def send(self, **command):
        await self.socket.send(json.dumps(command))


@pytest.mark.long
def test_a_viewer_who_looks_at_the_past_leaves_the_leading_page_in_the_present(session):
    """The viewer moves through the past as fast as it may; the other page leads on, and sees the present."""
    _, invite = session
    readings = []

    async def opened(stack, role):
        host, path = re.fullmatch(r"http://([^/]+)(/.*)", await asyncio.to_thread(invite, role)).groups()
        headers = {"Cookie": await asyncio.to_thread(cookie_of, host, path), "Origin": f"http://{host}"}
        url = f"ws://{host}/page"
        page = Looker(
            await stack.enter_async_context(
                connect(url, additional_headers=headers, origin=None, max_size=None)
            )
        )
        readings.append(asyncio.create_task(page.read()))
        stack.callback(readings[-1].cancel)
        return page

    async def true(condition):
        while not condition():
            for reading in readings:
                if reading.done():
                    reading.result()  # says why a page hears no more
            await asyncio.sleep(0.01)

    async def body():
        async with asyncio.timeout(100), AsyncExitStack() as stack:
            leader, viewer = await opened(stack, "operator"), await opened(stack, "viewer")
            await true(lambda: leader.state["pilots"])  # the device takes part once the scene is made
            await true(lambda: viewer.state.get("end", 0.0) > 1.0)
            await leader.send(do="lead", device="hand")  # the lead of a silent page ends after 3 s
            await true(lambda: leader.state["pilots"] == LED)
            seen, number = len(leader.times), 0
            while leader.times[-1] < leader.times[seen - 1] + 500_000_000 or number < 300:
                await viewer.send(do="at", time=0.2 + number % 80 / 100)
                await leader.send(do="hand", number=number, dead_man=True)
                await asyncio.sleep(0.004)
                number += 1
            assert leader.times == sorted(leader.times), "the present alone"
            assert leader.state["pilots"] == LED
            assert leader.errors == viewer.errors == []
            await true(lambda: viewer.times[-1] < 1_100_000_000)
            await leader.send(do="at", time=0.5)
            await true(lambda: leader.errors)
            assert "who leads a device sees what runs now" in leader.errors[0]

    finish(body())


def still(person):
    """Wait until the arm stands still, and return where."""
    place = [None]

    def stands():
        before, place[0] = place[0], person.page.evaluate(TIP)
        person.page.wait_for_timeout(150)
        return before is not None and max(abs(a - b) for a, b in zip(before, place[0], strict=True)) < 5e-5

    until(stands)
    return place[0]


def test_force_against_depth_and_pictures_that_the_page_draws(browser, tmp_path):
    """Of a recording without pictures; a block is pressed 54 mm deep with 50 N/m."""
    write_scene(tmp_path / "pressed", pictures=False)
    with served(Recorded(tmp_path / "pressed")) as server:
        one = Person(browser, f"http://127.0.0.1:{server.port}{server.gate.invite('viewer')}")
        one.sees("Boolean(trocar.scene?.placed)")
        one.page.get_by_role("img", name="force against depth").wait_for()
        (contact,) = read_bond_trace(
            recording := Recording(tmp_path / "pressed"), recording.scenario().bonds[0]
        ).contacts
        assert one.page.evaluate(PRESSED) == [
            [pytest.approx(1e3 * contact.depth[-1]), pytest.approx(50 * 0.054)]
        ]
        assert not one.page.get_by_role("img", name="Picture of").first.is_visible(), "it has no endoscope"
        assert one.errors == []
        one.context.close()


def test_a_warning_stays_above_the_scene_until_it_is_dismissed(person):
    one = person()
    one.sees("Boolean(trocar.session)")
    one.page.evaluate(
        """async () => {
          const { Alerts } = await import("/web/alerts.js")
          const alerts = new Alerts(document.getElementById("alerts"))
          const late = (text, time) => ({ time, level: "warn", source: "session", text })
          alerts.add([late("1 late step", 1), late("5 late steps", 9)])
          alerts.add([{ time: 1, level: "info", source: "task", text: "grasped" }])
          alerts.add([{ time: 0, level: "warn", source: "hand", text: "no page leads" }])
          alerts.leave(new Set(["hand"]))
        }"""
    )
    shown = one.page.locator(".alert")
    assert shown.count() == 1
    assert "5 late steps (2 times, last at 9.00 s)" in shown.inner_text()
    one.page.get_by_role("button", name="Dismiss").click()
    assert shown.count() == 0


def test_keys_move_slowly_with_shift_and_are_marked_while_they_are_held(person):
    one = person()
    one.sees("Boolean(trocar.session)")
    one.page.evaluate(
        """async () => {
          const { Pilot } = await import("/web/pilot.js"), panel = document.getElementById("lead")
          window.sent = []
          const feel = { pulse() {}, force() { return 0 } }
          const pilot = new Pilot(panel, { send: (one) => sent.push(one) }, feel)
          pilot.show([{ device: "hand", pilot: "you" }], "operator", "running")
        }"""
    )
    held = "[...document.querySelectorAll('.lead kbd.held')].map((one) => one.textContent)"
    for key in ("Space", "w", "v"):
        one.page.keyboard.down(key)
    assert one.page.evaluate("sent.at(-1)") | {"number": 0} == {
        "do": "hand",
        "number": 0,
        "drag": [0, 0, 0],
        "away": False,
        "linear": [1, 0, 0],
        "angular": [0, 0, 0],
        "turn": [0, 0, 0],
        "gripper": 1,
        "dead_man": True,
        "jaw": False,
        "pedal": False,
        "rinse": False,
    }
    assert one.page.evaluate(held) == ["w", "space", "v"]
    one.page.keyboard.down("Shift")
    slowly = one.page.evaluate("sent.at(-1)")
    assert (slowly["linear"], slowly["gripper"], slowly["dead_man"]) == ([0.2, 0, 0], 0.2, True)
    one.page.keyboard.up("w")
    assert one.page.evaluate(held) == ["space", "shift", "v"]
