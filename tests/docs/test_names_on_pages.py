"""Messages, files and modules that the documentation names exist."""

import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").rglob("*.md")),
]


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


def test_messages_in_troubleshooting_are_those_of_the_code():
    parts = [part for message in quoted_messages() for part in message.split("...")]
    assert len(parts) > 20
    unknown = [words for part in parts for words in re.split(r"'|: ", part) if words.strip() not in source()]
    assert unknown == []


def test_files_and_modules_that_a_page_names_exist():
    roots = (
        ROOT,
        *(ROOT / folder for folder in ("engines/bullet", "engines/mujoco", "engines/tissue", "robots/dvrk")),
    )
    missing = []
    for page in PAGES:
        text = page.read_text("utf-8")
        files = re.findall(r"`((?:[a-z_0-9]+/)+[a-z_0-9]+\.(?:py|c|json|yaml))`", text)
        modules = re.findall(r"`((?:hub|schemas|robots|engines|controllers|devices|tasks)(?:\.\w+)+)`", text)
        missing += [f"{page}: {name}" for name in files if not any((root / name).is_file() for root in roots)]
        missing += [f"{page}: {name}" for name in modules if not exists(name) and name != "hub.lab"]
    assert missing == []


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
