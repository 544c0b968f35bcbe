"""Make docs/pictures/page.gif: `palpation` live on the page, then its past on the timeline.

python docs/tools/page_gif.py   (needs trocar[all,test] and Debian's chromium; takes about two minutes)
"""

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from io import BytesIO
from pathlib import Path
from time import sleep

from PIL import Image
from playwright.sync_api import Page, sync_playwright

OUTPUT = Path(__file__).parents[1] / "pictures" / "page.gif"
SIZE, WIDTH, COLOURS = {"width": 1100, "height": 700}, 720, 96
LIVE_FROM_S, LIVE_S, BACK_S = 4.0, 3.0, (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)
TROCAR = (sys.executable, "-P", "-m", "trocar", "run", "palpation", "--open", "--set", "duration=2 min")


def film(page: Page) -> list[Image.Image]:
    """Return pictures of the page: live, back in the past, and live again."""
    pictures: list[Image.Image] = []

    def take() -> None:
        picture = Image.open(BytesIO(page.screenshot())).convert("RGB")
        height = round(WIDTH * picture.height / picture.width)
        pictures.append(picture.resize((WIDTH, height), Image.Resampling.LANCZOS))

    def until(expression: str) -> None:
        while not page.evaluate(expression):  # what waits within the page is against its policy
            sleep(0.05)

    until("Boolean(window.trocar?.scene?.placed)")
    until(f"trocar.time > {LIVE_FROM_S}")
    begin = page.evaluate("trocar.time")
    for share in range(16):
        until(f"trocar.time > {begin + LIVE_S * share / 15}")
        take()
    slider = page.get_by_role("slider", name="Instant")
    sleep(2.5)  # what has just happened is written
    for back in BACK_S:
        slider.fill(str(begin + LIVE_S - back))
        sleep(0.4)
        take()
    page.get_by_role("button", name="Live").click()
    for _ in range(4):
        sleep(0.6)
        take()
    return pictures


def _beside(*pictures: Image.Image) -> Image.Image:
    """Return one picture of several: before, in contact, and in the past."""
    width, height = pictures[0].size
    made = Image.new("RGB", (width, height * len(pictures)))
    for row, one in enumerate(pictures):
        made.paste(one, (0, row * height))
    return made


def main() -> None:
    """Run the session, film its page, and write the file."""
    flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with tempfile.TemporaryDirectory() as place:
        said = Path(place, "said")
        with said.open("w") as out:
            command = [*TROCAR, "--record", str(Path(place, "recorded"))]
            run = subprocess.Popen(command, stdout=out, stderr=out, env=os.environ | {"BROWSER": "true"})
        try:
            while not (link := re.search(r"http://127\S+", said.read_text())):
                sleep(0.1)
            with sync_playwright() as driver:
                browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
                page = browser.new_page(viewport=SIZE)
                page.goto(link[0])
                pictures = film(page)
                browser.close()
        finally:
            run.send_signal(signal.SIGINT)
            run.wait()
    # one palette for all, so that what stands still stays the same and takes no bytes
    palette = _beside(pictures[0], pictures[8], pictures[-len(BACK_S)]).quantize(
        COLOURS, method=Image.Quantize.MAXCOVERAGE
    )
    frames = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pictures]
    frames[0].save(OUTPUT, save_all=True, append_images=frames[1:], duration=350, loop=0, optimize=True)


if __name__ == "__main__":
    main()
