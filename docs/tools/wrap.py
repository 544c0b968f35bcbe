"""Wrap the prose of the Markdown files at 100 characters: `python docs/tools/wrap.py [--check] [FILE ...]`.

Tables, headings, fenced code and HTML stay as they are. A code span is never broken. `--check` changes
nothing, and ends with exit code 1 where this script would change a file; `make check` runs it.
"""

from __future__ import annotations

import argparse
import re
import sys
import textwrap
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WIDTH = 100
_GLUE = "\x00"
_ITEM = re.compile(r"^(\s*)((?:[-*+]|\d+\.)\s+)")
_UNITS = "%|[numk]?(?:m|s|g|N|J|W|Hz|Pa)|deg(?:rees)?|rad|[kKMG]i?B|uJ|times"
"""What stays on the line of the number before it."""
_VERBATIM = re.compile(r"^\s*(\|.*\|\s*$|#|<|!!!|\?\?\?|:::|\[[^\]]+\]:|---$)")


def pages() -> list[Path]:
    """Return every Markdown file that is held to the width."""
    top = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")]
    return [*top, *sorted((ROOT / "docs").rglob("*.md"))]


def wrapped(text: str) -> str:
    """Return `text` with its paragraphs and list items wrapped."""
    return "\n".join(_lines(text.splitlines())) + "\n"


def _lines(lines: list[str]) -> Iterator[str]:
    paragraph: list[str] = []
    fence = ""
    for line in lines:
        opening = re.match(r"^\s*(```+|~~~+)", line)
        if fence:
            fence = "" if opening and opening[1].startswith(fence) else fence
            yield line
            continue
        if opening or not line.strip() or _VERBATIM.match(line):
            yield from _paragraph(paragraph)
            if paragraph and line.lstrip().startswith("|"):
                yield ""  # Python-Markdown needs it
            paragraph = []
            fence = opening[1] if opening else ""
            yield line.rstrip()
            continue
        if _ITEM.match(line):
            yield from _paragraph(paragraph)
            if paragraph and not _ITEM.match(paragraph[0]):
                yield ""
            paragraph = []
        paragraph.append(line)
    yield from _paragraph(paragraph)


def _paragraph(lines: list[str]) -> Iterator[str]:
    if not lines:
        return
    item = _ITEM.match(lines[0])
    first = item[0] if item else lines[0][: len(lines[0]) - len(lines[0].lstrip())]
    rest = " " * len(first)
    text = " ".join(line.strip() for line in [lines[0][len(first) :], *lines[1:]])
    text = re.sub(r"`[^`]+`", lambda code: code[0].replace(" ", _GLUE), text)
    text = re.sub(r" (?=\||(?:[-+*#]|\d+\.)(?: |$))", _GLUE, text)  # no line begins like a list or table
    text = re.sub(rf"(?<=\d) (?=(?:{_UNITS})(?:\W|$))", _GLUE, text)
    filled = textwrap.fill(
        text,
        WIDTH,
        initial_indent=first,
        subsequent_indent=rest,
        break_long_words=False,
        break_on_hyphens=False,
    )
    yield filled.replace(_GLUE, " ")


def main() -> int:
    """Wrap the named files, or all of them; with `--check`, only name them. Return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="by default all pages")
    parser.add_argument("--check", action="store_true", help="change nothing, name what would change")
    options = parser.parse_args()
    changed = 0
    for path in options.files or pages():
        text = path.read_text("utf-8")
        if wrapped(text) != text:
            changed += 1
            if options.check:
                sys.stdout.write(f"{path}: run python docs/tools/wrap.py\n")
            else:
                path.write_text(wrapped(text), "utf-8")
                sys.stdout.write(f"wrapped {path}\n")
    return 1 if options.check and changed else 0


if __name__ == "__main__":
    sys.exit(main())
