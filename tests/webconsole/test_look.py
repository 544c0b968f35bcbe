"""What the page's files promise: contrast of its colours in light and dark, and nothing from elsewhere."""

import hashlib
import re
from itertools import product
from pathlib import Path

import pytest

WEB = Path(__file__).resolve().parents[2] / "webconsole" / "web"
VENDORED = {
    "TransformControls.js": "151befe25bb0d68626f9a6b033625b7b0cf6848e39ba71623b7bed8e3df565d6",
    "three.core.js": "613e370f76638fdef83926642bf256dc9615684922de1ce1f63a8583e5d78578",
    "three.module.js": "104f56145899722094556490d787aae0617cc2fc3382f31df02d724ea1aee341",
    "uPlot.esm.js": "5dd9b3281aa64b461b42d9945f6adb2649d346502b12281a9ae0d46599a80eba",
    "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
}
"""SHA-256 of the files of three 0.187.0 (build, examples/jsm/controls) and uplot 1.6.32 (dist) in npm."""


def themes():
    """Return the colours of light and dark, by name."""
    blocks = re.findall(r":root \{(.*?)\}", (WEB / "style.css").read_text(), re.S)
    light, dark = (dict(re.findall(r"--([\w-]+): (#[0-9a-f]{3,6})", block)) for block in blocks)
    return {"light": light, "dark": light | dark}


def luminance(colour):
    """Relative luminance (https://www.w3.org/TR/WCAG22/#dfn-relative-luminance)."""
    digits = colour[1:] if len(colour) == 7 else "".join(2 * digit for digit in colour[1:])
    shares = [int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4)]
    linear = [s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one, other):
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_texts_can_be_read(theme):
    colours = themes()[theme]
    for text, ground in product(("ink", "soft", "accent", "warn", "bad", "good"), ("panel", "ground")):
        assert contrast(colours[text], colours[ground]) >= 4.5, (text, ground)
    assert contrast(colours["on-accent"], colours["accent"]) >= 4.5
    assert contrast(colours["panel"], colours["bad"]) >= 4.5


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_lines_of_plots_can_be_seen(theme):
    colours = themes()[theme]
    for line in (f"s{i}" for i in range(7)):
        assert contrast(colours[line], colours["panel"]) >= 3.0, line


def test_vendored_files_are_as_they_were_published():
    found = {file.name for file in (WEB / "vendor").iterdir()}
    assert found == {*VENDORED, "three.LICENSE", "uPlot.LICENSE"}
    for name, digest in VENDORED.items():
        published = (WEB / "vendor" / name).read_bytes()
        if (
            name == "TransformControls.js"
        ):  # a bare name is nothing that a page without an import map can load
            published = published.replace(b"from './three.module.js'", b"from 'three'")
        assert hashlib.sha256(published).hexdigest() == digest


def test_own_files_name_no_other_server():
    for file in WEB.glob("*.*"):
        for url in re.findall(r"https?://[^\s\"'`)]+", file.read_text()):
            comment = f"// Buttons and axes of {url}"
            assert comment in file.read_text() or url == "http://www.w3.org/2000/svg", f"{file.name}: {url}"
    assert " style=" not in (WEB / "index.html").read_text()
    assert not re.search(r"<script(?![^>]*src)|\son\w+=", (WEB / "index.html").read_text())
