"""Make docs/pictures/gallery/page-keys.webp: keys of the page lead an arm of `browser`, which carries a ring.

python docs/tools/page_keys.py   (needs trocar[all,test], Debian's chromium, and an idle machine)

The keys are pressed by this program, which looks at the page alone: where tip and ring are drawn. A page
without a GPU is slow: this one is small and plain while it leads; the device forgives a second of silence.
Then the page shows the recording, and each picture is one of its instants; where nothing moves there is none.
Where the ring is not carried off within 15 minutes the program ends with an error.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from time import monotonic, sleep
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from playwright.sync_api import Page, sync_playwright

OUTPUT = Path(__file__).parents[1] / "pictures" / "gallery" / "page-keys.webp"
LARGEST, LONGEST_S = 3_000_000, 900.0
"""Bytes of the film; wall time in which the ring has to be carried off."""
SMALL, LARGE, QUALITIES = {"width": 360, "height": 480}, {"width": 900, "height": 800}, (70, 50, 30)
SHOWN_MS, LAST_MS = 120, 1500
STEP_M, STEP_RAD = 4e-3, 0.12
"""Motion of the tip or the jaw between two pictures."""
ARM, RING, DEVICE = "PSM2", "ring2", "left"
REACH, DEPTH, MIDDLE, HALF = 10.2e-3, 4.0e-3, 4.5e-3, 7.25e-3
"""Fingers of the jaw; their depth over a wall; from axis to middle of a wall; half the ring's height: m."""
WALL = np.pi / 6 + 2 * np.pi / 3
"""Angle of the outward normal of that wall in the ring's frame, rad."""
OPEN, WIDE, LIFT = (0.15, 0.27), 0.5, 0.034
"""Jaw over the wall, and from where on it closes slowly, rad; way up off the post, m."""
CARRY = (-0.06, 0.03, 0.01)
"""Way from above the post, m."""
NEAR, CLOSE, SPEED = 4e-3, 0.8e-3, 40e-3
"""From where on Shift is held, and how near is there: m. Speed of the device, m/s."""
SETTLE_S, STILL = 0.15, 3e-4
"""An arm at rest moves less (m, rad) in so much simulated time."""
SEEN = """([arm, thing]) => {
  const world = (one) => { one.updateWorldMatrix(true, false); return one.matrixWorld.toArray() }
  const { names, groups } = trocar.scene.parts[0], body = (name) => world(groups[names.indexOf(name)])
  const camera = trocar.scene.cameras[0]
  return {
    tip: world(trocar.scene.tips.find(({ name }) => name === arm).axes), thing: body(thing),
    fingers: ["left", "right"].map((side) => body(`${arm}/jaw_${side}`)), time: trocar.time,
    camera: world(camera.group), view: camera.pose,
    pill: document.getElementById("dead-man")?.textContent ?? "",
  }
}"""
FONT = ImageFont.load_default(24)
TAKE = f"[...document.querySelectorAll('button')].find(one => one.textContent === 'Lead {DEVICE}')?.click()"
DIRECTIONS = (("w", "s"), ("a", "d"), ("r", "f"))
TROCAR = (sys.executable, "-P", "-m", "trocar", "run", "browser", "--open")
CHANGES = ("endoscope.images=none", f"{DEVICE}.silence=1 s", f"{DEVICE}.speed=40 mm/s")

Vector = NDArray[np.float64]


def pose(columns: list[float]) -> Vector:
    """Return a matrix, shape (4, 4), of what the page says."""
    return np.array(columns).reshape(4, 4).T


def rotation(x: float, y: float, z: float, w: float) -> Vector:
    """Return the matrix of a quaternion."""
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


class Moment(NamedTuple):
    """What a picture is to show."""

    time: float
    keys: str


class Person:
    """Who looks at the page and presses its keys."""

    def __init__(self, page: Page) -> None:
        self.page, self.held, self.pulsed = page, set[str](), ""
        self.moments: list[Moment] = []
        self.deadline = monotonic() + LONGEST_S
        self._shown: tuple[Vector, float] | None = None

    def look(self) -> dict[str, Any]:
        """Return what is drawn; note moments of the film, and press space anew when asked to."""
        if monotonic() > self.deadline:
            raise TimeoutError(f"the ring is not carried off after {LONGEST_S:g} s: is the machine idle?")
        seen = self.page.evaluate(SEEN, [ARM, RING])
        tip, jaw = pose(seen["tip"])[:3, 3], opening(seen)
        if self._shown is None or (
            np.linalg.norm(tip - self._shown[0]) / STEP_M + abs(jaw - self._shown[1]) / STEP_RAD >= 1
        ):
            self._shown = tip, jaw
            self.moments.append(Moment(seen["time"], self.pulsed))
        if not seen["pill"]:  # a page that was silent for three seconds leads no more
            self.take()
        elif "let go of" in seen["pill"]:
            self.page.keyboard.up("Space")
            self.page.keyboard.down("Space")
        return seen

    def take(self) -> None:
        """Lead the device, with the dead-man held."""
        self.press()
        self.page.evaluate(TAKE)
        wait(self.page, "Boolean(document.getElementById('dead-man'))")
        self.press("Space")

    def press(self, *keys: str) -> None:
        """Hold these keys alone."""
        for key in self.held - {*keys}:
            self.page.keyboard.up(key)
        for key in keys:
            if key not in self.held:
                self.page.keyboard.down(key)
        self.held = {*keys}

    def settled(self) -> dict[str, Any]:
        """Return what is drawn once the arm has come to rest."""
        seen = self.look()
        while True:
            before = seen
            while (seen := self.look())["time"] < before["time"] + SETTLE_S:
                sleep(0.02)
            if np.abs(pose(seen["tip"]) - pose(before["tip"])).max() < STILL:
                return seen

    def pulse(self, seconds: float, *keys: str) -> dict[str, Any]:
        """Hold keys for a while, and return what is drawn when the arm has come to rest."""
        self.pulsed = " ".join(("Space", *keys))
        self.press("Space", *keys)
        self.look()
        self.page.wait_for_timeout(1e3 * seconds)
        self.press("Space")
        return self.settled()

    def go(self, goal: Callable[[dict[str, Any]], Vector], close: float = CLOSE) -> None:
        """Lead the tip until it is at a goal in the world, m."""
        seen = self.settled()
        while (left := float(np.linalg.norm(way := goal(seen) - pose(seen["tip"])[:3, 3]))) > close:
            right, down, ahead = (pose(seen["camera"])[:3, :3] @ rotation(*seen["view"][3:])).T
            shares = np.array([ahead @ way, -right @ way, -down @ way])
            first = int(np.abs(shares).argmax())
            key, most = DIRECTIONS[first][int(shares[first] < 0)], abs(float(shares[first]))
            shift = ["Shift"] if left < NEAR else []
            seen = self.pulse(min(most / (SPEED * (0.2 if shift else 1.0)), 0.6), *shift, key)

    def line(self, goal: Vector, parts: int) -> None:
        """Lead the tip along a straight line."""
        start = pose(self.look()["tip"])[:3, 3]
        for share in np.linspace(0, 1, parts + 1)[1:]:
            self.go(lambda _, point=start + share * (goal - start): point, 1.2e-3)

    def narrow(self) -> None:
        """Open the jaw as wide as it goes over the wall."""
        while not OPEN[0] < (jaw := opening(self.settled())) < OPEN[1]:
            shift = ["Shift"] if jaw < WIDE else []
            self.pulse(0.15, *shift, "c" if jaw > OPEN[1] else "v")

    def lead(self) -> None:
        """Take the ring off its post, and carry it away."""
        self.take()
        self.go(lambda seen: grasp(seen) - 0.015 * pose(seen["tip"])[:3, 2] + [0, 0, 0.01], 2e-3)
        self.narrow()
        self.go(lambda seen: grasp(seen) - 0.008 * pose(seen["tip"])[:3, 2])
        self.go(grasp)
        for _ in range(3):
            self.pulse(0.6, "c")
        above = pose(self.settled()["tip"])[:3, 3] + [0, 0, LIFT]
        lying = pose(self.look()["thing"])[2, 3]
        self.line(above, 5)
        self.line(above + CARRY, 3)
        if pose(self.settled()["thing"])[2, 3] < lying + LIFT / 2:
            raise RuntimeError(f"{RING} is not in the jaw of {ARM}: it was lost on the way; run this again")


def opening(seen: dict[str, Any]) -> float:
    """Return the angle between the fingers, rad."""
    left, right = (pose(one)[:3, 1] for one in seen["fingers"])
    return float(np.arccos(np.clip(-left @ right, -1, 1)))


def grasp(seen: dict[str, Any]) -> Vector:
    """Return where the tip has to be for the fingers to be on either side of the wall, m."""
    ring, tip = pose(seen["thing"]), pose(seen["tip"])
    normal = ring[:3, :3] @ [np.cos(WALL), np.sin(WALL), 0]
    fingers = tip[:3, 2]
    along = DEPTH / 2 * fingers / abs(fingers[2])  # the middle of what is over the wall is its middle
    return ring[:3, 3] + MIDDLE * normal + [0, 0, HALF - DEPTH / 2] + along - REACH * fingers


def film(page: Page, moments: list[Moment]) -> list[Image.Image]:
    """Return pictures of the recording on the page, with the keys that were held."""
    page.set_viewport_size(LARGE)
    page.get_by_role("slider", name="Instant of the recording").wait_for()
    wait(page, "Boolean(trocar.scene?.placed && trocar.scene.surfaces[0]?.mesh)")
    page.get_by_role("radio", name="Endoscope").click()
    page.get_by_label("Looks of the scene").select_option("full")
    pictures: list[Image.Image] = []
    for time, keys in moments:
        page.get_by_role("slider", name="Instant of the recording").fill(f"{time:.3f}")
        wait(page, f"Math.abs(trocar.framed - {time:.3f}) < 1e-3")
        drawn = page.evaluate("trocar.drawn")
        page.evaluate("trocar.scene.dirty()")
        wait(page, f"trocar.drawn > {drawn}")
        shot = page.locator("#canvas").screenshot()
        picture = Image.open(BytesIO(shot)).convert("RGB")
        ImageDraw.Draw(picture).text((16, picture.height - 40), keys, fill="white", font=FONT)
        pictures.append(picture)
    return pictures


def wait(page: Page, expression: str) -> None:
    """Wait until an expression of the page is true; what waits within the page is against its policy."""
    while not page.evaluate(expression):
        sleep(0.05)


def main() -> None:
    """Run the session, lead, film the recording, and write the file."""
    flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with tempfile.TemporaryDirectory() as place:
        said = Path(place, "said")
        changes = [word for change in CHANGES for word in ("--set", f"participants.{change}")]
        with said.open("w") as out:
            command = [*TROCAR, "--record", str(Path(place, "recorded")), *changes]
            run = subprocess.Popen(command, stdout=out, stderr=out, env=os.environ | {"BROWSER": "true"})
        try:
            while not (link := re.search(r"http://127\S+(?=\s)", said.read_text())):
                sleep(0.1)
            with sync_playwright() as driver:
                browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
                page = browser.new_page(viewport=SMALL)
                page.set_default_timeout(600_000)
                page.on("dialog", lambda dialog: dialog.accept())  # whether the session is to end
                page.add_init_script('localStorage.setItem("trocar-looks", "plain")')
                page.goto(link[0])
                wait(page, "Boolean(window.trocar?.scene?.placed)")
                person = Person(page)
                person.lead()
                person.press()
                page.get_by_role("button", name="Stop").click()
                pictures = film(page, person.moments)
                browser.close()
        finally:
            run.send_signal(signal.SIGINT)
            run.wait()
    durations = [SHOWN_MS] * (len(pictures) - 1) + [LAST_MS]
    for quality in QUALITIES:
        options: dict[str, Any] = {"duration": durations, "loop": 0, "quality": quality, "method": 6}
        pictures[0].save(OUTPUT, save_all=True, append_images=pictures[1:], **options)
        if OUTPUT.stat().st_size < LARGEST:
            break


if __name__ == "__main__":
    main()
