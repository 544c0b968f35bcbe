"""`docs/tools/decisions.py` finds what is wrong with a decision page or the index."""

import importlib.util
from pathlib import Path

import pytest

TOOL = Path(__file__).parents[2] / "docs" / "tools" / "decisions.py"
ROWS = "| 1 | [Steps](0001-steps.md) | one |\n| 2 | [Tags](0002-tags.md) | two |\n"
INDEX = "# Decisions\n\n## Read these first\n\n" + ROWS * 6 + "\n## Time\n\n" + ROWS
PAGES = {
    "0001-steps.md": "# 1. Steps\n\nStatus: revised by [2](0002-tags.md).\n\n"
    "Text. [Details](details/0001-steps.md).\n",
    "0002-tags.md": "# 2. Tags\n\nStatus: current.\n\nText.\n",
    "details/0001-steps.md": "# Details of decision 1\n",
    "index.md": INDEX,
}


def faults(folder, **changed):
    """Write the pages with some of them changed, and return what the tool says."""
    spec = importlib.util.spec_from_file_location("decisions", TOOL)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    (folder / "details").mkdir()
    for name, text in (PAGES | changed).items():
        (folder / name).write_text(text, "utf-8")
    return tool.faults(folder)


def test_good_pages_have_no_fault(tmp_path):
    assert not faults(tmp_path)


@pytest.mark.parametrize(
    ("name", "old", "new", "fault"),
    [
        ("0002-tags.md", "Status: current.\n\n", "", "second paragraph"),
        ("0002-tags.md", "current.", "revised by [1](0001-steps.md).", "not a later decision"),
        ("0002-tags.md", "Text.", "word " * 801, "at most 800"),
        ("0001-steps.md", "[Details](details/0001-steps.md)", "Details", "no link to details"),
        ("0001-steps.md", "# 1. Steps", "# 01 Steps", "first line"),
        ("0002-tags.md", "Tags", "Labels", "as 'Labels'"),
        ("index.md", "\n## Time\n\n" + ROWS, "", "once below a subject"),
        ("index.md", ROWS * 6, ROWS * 5, "lists 10 pages, 12"),
    ],
)
def test_a_fault_is_named(tmp_path, name, old, new, fault):
    found = faults(tmp_path, **{name: PAGES[name].replace(old, new)})
    assert any(fault in line for line in found), found
