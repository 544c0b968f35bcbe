"""Make docs/pictures/gallery/page-keys.webp: keys of the page lead an arm of `browser` that presses a kidney.

python docs/tools/page_keys.py   (needs trocar[all,test] and Debian's chromium; takes about a minute)

This program presses the keys, and looks at the page alone: where tip and kidney are drawn. Each picture is
taken while keys are held. A page without a GPU is slow: the device forgives a second of silence.
"""

import tempfile
from io import BytesIO
from pathlib import Path
from time import monotonic, sleep
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from opened_page import opened, wait
from PIL import Image
from playwright.sync_api import Page, ViewportSize

OUTPUT = Path(__file__).parents[1] / "pictures" / "gallery" / "page-keys.webp"
LARGEST, LONGEST_S = 3_000_000, 900.0
"""Bytes of the film; wall time in which the kidney has to be pressed."""
SIZE, WIDTH = ViewportSize(width=1200, height=860), 800
SHOWN_MS, LAST_MS, QUALITIES = 350, 1500, (60, 45, 30)
ARM, DEVICE, SPEED, SLOWLY = "PSM1", "right", 12e-3, 0.2
"""Speed of the device, m/s, and its share with Shift."""
ABOVE, DEPTH, ASIDE, NEAR, CLOSE = 12e-3, 6e-3, 8e-3, 4e-3, 1e-3
"""Way over the kidney and into it, a drag, from where on Shift is held, and how near is there: m."""
STILL, SETTLE_S, MOST_S = 4e-4, 0.12, 1.2
"""An arm at rest moves less (m, rad) in so much simulated time; longest stroke of a key, s."""
SEEN = """(arm) => {
  const world = (one) => { one.updateWorldMatrix(true, false); return one.matrixWorld.toArray() }
  const camera = trocar.scene.cameras[0]
  return {
    tip: world(trocar.scene.tips.find(({ name }) => name === arm).axes), time: trocar.time,
    camera: world(camera.group), view: camera.pose,
    pill: document.getElementById("dead-man")?.textContent ?? "",
  }
}"""
KIDNEY = "[...(trocar.scene.surfaces[0]?.positions ?? [])]"
TAKE = f"[...document.querySelectorAll('button')].find(one => one.textContent === 'Lead {DEVICE}')?.click()"
WAYS = (("d", "a"), ("f", "r"), ("w", "s"))
"""Keys along and against the axes of the picture: right, down, ahead."""
SESSION = ("run", "browser", "--open")
SCRIPT = 'localStorage.setItem("trocar-looks", "plain")'
CHANGES = ("endoscope.images=none", f"{DEVICE}.silence=1 s", f"{DEVICE}.speed={SPEED}")

Vector = NDArray[np.float64]


def pose(columns: list[float]) -> Vector:
    """Return a matrix, shape (4, 4), of what the page says."""
    return np.array(columns).reshape(4, 4).T


def rotation(x: float, y: float, z: float, w: float) -> Vector:
    """Return the matrix of a quaternion."""
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


class Seen(NamedTuple):
    """What the page shows."""

    tip: Vector
    """Position in the world, m."""
    axes: Vector
    """Axes of the picture in the world: right, down, ahead."""
    time: float
    pill: str


class Person:
    """Who looks at the page and presses its keys."""

    def __init__(self, page: Page) -> None:
        self.page, self.held = page, set[str]()
        self.pictures: list[Image.Image] = []
        self._deadline = monotonic() + LONGEST_S

    def look(self) -> Seen:
        """Return what is drawn; press space anew where the page asks for it."""
        if monotonic() > self._deadline:
            raise TimeoutError(f"the kidney is not pressed after {LONGEST_S:g} s: is the machine idle?")
        found: dict[str, Any] = self.page.evaluate(SEEN, ARM)
        pill = found["pill"]
        if not pill:
            self.take()
        elif "let go of" in pill or "press space" in pill:
            self.press()
            self.page.wait_for_timeout(150)
            self.press("Space")
        axes = pose(found["camera"])[:3, :3] @ rotation(*found["view"][3:])
        return Seen(pose(found["tip"])[:3, 3], axes, found["time"], pill)

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

    def picture(self) -> None:
        """Take a picture for the film."""
        shot = Image.open(BytesIO(self.page.screenshot())).convert("RGB")
        height = round(WIDTH * shot.height / shot.width)
        self.pictures.append(shot.resize((WIDTH, height), Image.Resampling.LANCZOS))

    def stroke(self, seconds: float, *keys: str) -> Seen:
        """Hold keys for a while; return what is drawn when the arm has come to rest."""
        begun = monotonic()
        self.press("Space", *keys)
        self.picture()
        self.page.wait_for_timeout(max(1e3 * (seconds - (monotonic() - begun)), 0.0))
        self.press("Space")
        seen = self.look()
        while True:
            before = seen
            while (seen := self.look()).time < before.time + SETTLE_S:
                sleep(0.02)
            if np.abs(seen.tip - before.tip).max() < STILL:
                return seen

    def go(self, goal: Vector) -> None:
        """Lead the tip to a place in the world, m."""
        seen = self.look()
        while float(np.linalg.norm(way := goal - seen.tip)) > CLOSE:
            shares = seen.axes.T @ way
            first = int(np.abs(shares).argmax())
            slow = abs(shares[first]) < NEAR
            seconds = abs(float(shares[first])) / (SPEED * (SLOWLY if slow else 1.0))
            key = WAYS[first][int(shares[first] < 0)]
            seen = self.stroke(min(seconds, MOST_S), *(["Shift"] if slow else []), key)

    def lead(self) -> None:
        """Open and close the jaw, press the kidney, drag it along, and let it go."""
        self.take()
        for key in "vc":
            self.stroke(MOST_S, key)
        nodes = np.array(self.page.evaluate(KIDNEY)).reshape(-1, 3)
        top = nodes[np.argsort(nodes[:, 2])[-10:]].mean(axis=0)
        for beside, height in ((0.0, ABOVE), (0.0, -DEPTH), (ASIDE, -DEPTH), (ASIDE, 2 * ABOVE)):
            self.go(np.add(top, (beside, 0.0, height)))
            self.picture()


def main() -> None:
    """Run the session, lead, and write the film."""
    changes = [word for change in CHANGES for word in ("--set", f"participants.{change}")]
    with tempfile.TemporaryDirectory() as place:
        command = (*SESSION, "--record", str(Path(place, "recorded")), *changes)
        with opened(*command, size=SIZE, script=SCRIPT) as page:
            wait(page, "Boolean(window.trocar?.scene?.placed && trocar.scene.surfaces[0]?.mesh)")
            page.get_by_role("radio", name="Endoscope").click()
            person = Person(page)
            person.lead()
            person.press()
    durations = [SHOWN_MS] * (len(person.pictures) - 1) + [LAST_MS]
    for quality in QUALITIES:
        options: dict[str, Any] = {"duration": durations, "loop": 0, "quality": quality, "method": 6}
        person.pictures[0].save(OUTPUT, save_all=True, append_images=person.pictures[1:], **options)
        if OUTPUT.stat().st_size < LARGEST:
            break


if __name__ == "__main__":
    main()
