"""The documentation builds without a warning, loads nothing from elsewhere, and covers the code."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hub.planning.registry import kinds

pytestmark = [
    pytest.mark.release,
    pytest.mark.xdist_group("site"),  # its fixtures are expensive: made once, in one process
]

pytest.importorskip("mkdocs")
ROOT = Path(__file__).parents[2]
LOADED = re.compile(r"<(?:script|link|img|iframe|source|video|audio|object|embed)\b[^>]*>")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built strictly."""
    directory = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", directory],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return directory


def test_nothing_on_it_is_loaded_from_elsewhere(site):
    pages = list(site.rglob("*.html"))
    assert len(pages) > 80
    for page in pages:
        for tag in LOADED.findall(page.read_text("utf-8")):
            assert not re.search(r"""(src|href)=["']?(https?:)?//""", tag), f"{page}: {tag}"
    for style in site.rglob("*.css"):
        assert not re.search(r"url\(\s*['\"]?(https?:)?//", style.read_text("utf-8")), style


def test_no_page_has_a_diagram_that_the_browser_would_load_mermaid_for(site):
    assert not any('class="mermaid"' in page.read_text("utf-8") for page in site.rglob("*.html"))


def test_every_kind_has_a_page_with_its_parameters(site):
    for name in kinds():
        text = (site / "reference" / "kinds" / f"{name}.html").read_text("utf-8")
        assert "Parameters" in text, name
        assert "Ports" in text, name


def test_the_figures_are_those_of_the_script(tmp_path):
    text = "import sys; sys.path.insert(0, 'docs/tools'); import figures, pathlib;"
    text += f" figures.FOLDER = pathlib.Path({str(tmp_path)!r}); figures.main()"
    subprocess.run([sys.executable, "-c", text], cwd=ROOT, check=True)
    drawn = {file.name: file.read_text("utf-8") for file in tmp_path.glob("*.svg")}
    kept = {file.name: file.read_text("utf-8") for file in (ROOT / "docs" / "figures").glob("*.svg")}
    assert drawn == kept, "python docs/tools/figures.py"
