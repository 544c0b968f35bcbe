"""How the documentation is written: lines of 100 characters, plain words, messages that exist."""

import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    *sorted(page for page in (ROOT / "docs").rglob("*.md")),
]
WIDTH = 100
NOT_OURS = re.compile(r"\b(un)?told\b|\bnobody\b|\bwants\b|\bwhoever\b|\bheed(s|ed)?\b", re.IGNORECASE)
"""Words with a plainer one: publish, send, report; no program, none; needs; each; accept, execute."""


def prose(page):
    """Yield number and text of the lines that are neither code nor table."""
    fenced = False
    for number, line in enumerate(page.read_text("utf-8").splitlines(), 1):
        if line.lstrip().startswith("```"):
            fenced = not fenced
        elif not fenced and not line.startswith("|"):
            yield number, line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_lines_of_prose_have_100_characters_at_most(page):
    for number, line in prose(page):
        assert len(line) <= WIDTH or " " not in line.strip(), f"{page}:{number}: {line}"


def test_the_wrapping_script_changes_nothing():
    text = "import sys; sys.path.insert(0, 'docs/tools'); import wrap; print([str(p) for p in wrap.pages()"
    text += " if wrap.wrapped(p.read_text('utf-8')) != p.read_text('utf-8')])"
    done = subprocess.run([sys.executable, "-c", text], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]", "python docs/tools/wrap.py"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_words_are_plain(page):
    for number, line in enumerate(page.read_text("utf-8").splitlines(), 1):
        assert not NOT_OURS.search(line), f"{page}:{number}: {line}"


@pytest.mark.parametrize(
    "folder",
    [
        *("hub", "schemas", "robots", "engines", "controllers", "devices", "tasks", "learning"),
        *("webconsole", "trocar"),
    ],
)
def test_words_of_what_ships_are_plain(folder):
    for file in sorted((ROOT / folder).rglob("*.py")):
        for number, line in enumerate(file.read_text("utf-8").splitlines(), 1):
            assert not NOT_OURS.search(line), f"{file}:{number}: {line}"


@cache
def source():
    """All code as one text, without the seams between the parts of a string."""
    folders = (
        *("hub", "schemas", "robots", "engines", "controllers", "devices", "tasks", "learning"),
        *("webconsole", "trocar"),
    )
    files = [file for folder in folders for file in sorted((ROOT / folder).rglob("*.py"))]
    text = "\n".join(file.read_text("utf-8") for file in files)
    return re.sub(r'"\s*\n\s*f?"', "", text)


def quoted_messages():
    """Yield each message in the first column of the tables of troubleshooting."""
    for line in (ROOT / "docs" / "troubleshooting.md").read_text("utf-8").splitlines():
        found = re.match(r"\| `([^`]+)` \|", line)
        if found:
            yield found[1]


@pytest.mark.parametrize("message", list(quoted_messages()))
def test_messages_in_troubleshooting_are_those_of_the_code(message):
    for part in message.split("..."):
        for words in re.split(r"'|: ", part):
            assert words.strip() in source(), words


@pytest.mark.parametrize(
    "page", [p for p in PAGES if p.name != "CHANGELOG.md"], ids=lambda page: str(page.relative_to(ROOT))
)
def test_files_and_modules_that_a_page_names_exist(page):
    text = page.read_text("utf-8")
    for name in re.findall(r"`((?:[a-z_0-9]+/)+[a-z_0-9]+\.(?:py|c|json|yaml))`", text):
        roots = (ROOT, *(ROOT / folder for folder in ("engines/bullet", "engines/mujoco", "robots/dvrk")))
        assert any((root / name).is_file() for root in roots), f"{page}: {name}"
    for name in re.findall(r"`((?:hub|schemas|robots|engines|controllers|devices|tasks)(?:\.\w+)+)`", text):
        assert exists(name) or name == "hub.lab", f"{page}: {name}"


def exists(dotted):
    """Say whether a dotted name is a module, or something in one."""
    parts = dotted.split(".")
    for length in range(len(parts), 0, -1):
        base = ROOT.joinpath(*parts[:length])
        if base.is_dir() or base.with_suffix(".py").is_file():
            return length == len(parts) or all(
                re.search(rf"\b{part}\b", module.read_text("utf-8"))
                for part in parts[length : length + 1]
                for module in [base / "__init__.py" if base.is_dir() else base.with_suffix(".py")]
            )
    return False
