"""Make docs/pictures/page-looks.jpg: the endoscope of `retraction`, drawn by the page and by Filament.

python docs/tools/page_looks.py   (needs trocar[all,test] and Debian's chromium; takes about two minutes)
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from gallery import SHOTS, run
from opened_page import TROCAR, opened, wait
from PIL import Image

OUTPUT = Path(__file__).parents[1] / "pictures" / "page-looks.jpg"
TIME_S, SIZE, GAP = 6.0, (520, 416), 7
SCRIPT = 'localStorage.setItem("trocar-looks", "full")'


def drawn_by_the_page(recording: Path) -> Image.Image:
    """Return the picture that the page draws, from the endoscope, as high as an eye sees."""
    with opened("view", str(recording), size={"width": 1400, "height": 980}, script=SCRIPT) as page:
        wait(page, "Boolean(window.trocar?.scene?.placed && trocar.scene.surfaces[0]?.mesh)")
        page.get_by_role("radio", name="Endoscope").click()
        page.get_by_role("slider", name="Instant").fill(str(TIME_S))
        wait(page, "trocar.scene.level === 'full'")
        page.wait_for_timeout(5_000)  # the scene settles
        page.evaluate("trocar.scene.camera.layers.set(0)")  # no arrows of forces: no eye sees them
        with page.expect_download() as shot:
            page.get_by_role("button", name="Picture", exact=True).click()
        picture = Image.open(shot.value.path()).convert("RGB")
    height = round(picture.width * SIZE[1] / SIZE[0])
    top = (picture.height - height) // 2
    return picture.crop((0, top, picture.width, top + height)).resize(SIZE, Image.Resampling.LANCZOS)


def drawn_by_filament(recording: Path) -> Image.Image:
    """Return the picture of the left eye that `trocar render` draws."""
    with tempfile.TemporaryDirectory() as place:
        file = Path(place, "left.png")
        width, height = map(str, SIZE)
        options = ["--time", str(TIME_S), "--camera", "left", "--looks", "endoscope", "-o", str(file)]
        command = [*TROCAR, "render", str(recording), *options, "--width", width, "--height", height]
        subprocess.run(command, check=True, stdout=sys.stderr)
        with Image.open(file) as picture:
            return picture.convert("RGB")


def main() -> None:
    """Run the scenario, unless the gallery has, and draw it both ways."""
    shot = next(shot for shot in SHOTS if shot.name == "retraction")
    run(shot)
    gap = np.full((SIZE[1], GAP, 3), 255, np.uint8)
    page, filament = drawn_by_the_page(shot.recording), drawn_by_filament(shot.recording)
    Image.fromarray(np.hstack((np.asarray(page), gap, np.asarray(filament)))).save(OUTPUT, quality=88)


if __name__ == "__main__":
    main()
