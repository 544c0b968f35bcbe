"""Make docs/pictures/page.gif: `palpation` live on the page, then its past on the timeline.

python docs/tools/page_gif.py   (needs trocar[all,test] and Debian's chromium; takes about two minutes)
"""

import tempfile
from io import BytesIO
from pathlib import Path
from time import sleep

from opened_page import opened, wait
from PIL import Image
from playwright.sync_api import Page, ViewportSize

OUTPUT = Path(__file__).parents[1] / "pictures" / "page.gif"
SIZE, WIDTH, COLOURS = ViewportSize(width=1100, height=700), 720, 128
ACCENTS, STRIPE = ("#f2b705", "#8a5200", "#b3261e", "#00695f", "#1b6e3c", "#0b62a4", "#b84a00"), 16
"""Of arrows, warnings, what stops, what is chosen, and plots."""
LIVE_FROM_S, LIVE_S, BACK_S = 4.0, 3.0, (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)
SESSION = ("run", "palpation", "--open", "--set", "duration=2 min")


def film(page: Page) -> list[Image.Image]:
    """Return pictures of the page: live, back in the past, and live again."""
    pictures: list[Image.Image] = []

    def take() -> None:
        picture = Image.open(BytesIO(page.screenshot())).convert("RGB")
        height = round(WIDTH * picture.height / picture.width)
        pictures.append(picture.resize((WIDTH, height), Image.Resampling.LANCZOS))

    wait(page, "Boolean(window.trocar?.scene?.placed)")
    wait(page, f"trocar.time > {LIVE_FROM_S}")
    begin = page.evaluate("trocar.time")
    for share in range(16):
        wait(page, f"trocar.time > {begin + LIVE_S * share / 15}")
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


def _colours(picture: Image.Image) -> Image.Image:
    """Return a picture with stripes below it of the colours that must be in the palette, however few."""
    width, height = picture.size
    made = Image.new("RGB", (width, height + STRIPE * len(ACCENTS)))
    made.paste(picture, (0, 0))
    for row, colour in enumerate(ACCENTS):
        made.paste(colour, (0, height + STRIPE * row, width, height + STRIPE * (row + 1)))
    return made


def main() -> None:
    """Run the session, film its page, and write the file."""
    with (
        tempfile.TemporaryDirectory() as place,
        opened(*SESSION, "--record", str(Path(place, "recorded")), size=SIZE) as page,
    ):
        pictures = film(page)
    # one palette for all, so that what stands still stays the same and takes no bytes
    palette = _colours(pictures[8]).quantize(COLOURS, method=Image.Quantize.MEDIANCUT)
    frames = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in pictures]
    frames[0].save(OUTPUT, save_all=True, append_images=frames[1:], duration=350, loop=0, optimize=True)


if __name__ == "__main__":
    main()
