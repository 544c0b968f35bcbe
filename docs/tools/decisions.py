"""Checks the form of the decision pages: `make check` runs `python docs/tools/decisions.py`.

- A page begins with `# NUMBER. Title` and a status line: `Status: current.`, or `Status: revised by` or
  `superseded by` with links to later decisions.
- A page has at most 800 words, those of tables included, those of code blocks excluded. Older figures stand
  in `docs/decisions/details/`.
- The index lists each page once, below the heading of its subject, by its title. It begins with the twelve
  pages to read first.
- Each page of details is linked by its decision.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1] / "decisions"
MAX_WORDS = 800
FIRST = 12
"""Number of pages to read first."""
_LINK = r"\[\d+\]\(\d{4}-[\w-]+\.md\)"
_STATUS = re.compile(rf"Status: (?:current|(?:revised|superseded) by {_LINK}(?:, {_LINK})*)\.")
_ROW = re.compile(r"^\| \d+ \| \[(.+?)\]\((\d{4}-[\w-]+\.md)\) \|", re.MULTILINE)


def word_count(text: str) -> int:
    """Return the number of words of a page, without code blocks and the targets of links."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"\]\([^)]*\)", "]", text)
    return sum(bool(re.search(r"\w", word)) for word in text.split())


def page_faults(page: Path) -> Iterator[str]:
    """Yield what is wrong with one decision."""
    text = page.read_text("utf-8")
    number = int(page.name[:4])
    parts = text.split("\n\n", 2)
    if not re.fullmatch(rf"# {number}\. .+", parts[0]):
        yield f"the first line is '# {number}. Title'"
    status = " ".join(parts[1].split()) if len(parts) > 1 else ""
    if not _STATUS.fullmatch(status):
        yield "the second paragraph is 'Status: current.', 'Status: revised by [N](PAGE).' or 'superseded by'"
    for name in re.findall(r"\((\d{4}-[\w-]+\.md)\)", status):
        if not (page.parent / name).is_file() or int(name[:4]) <= number:
            yield f"the status names {name}, which is not a later decision"
    words = word_count(text)
    if words > MAX_WORDS:
        yield f"{words} words, at most {MAX_WORDS}: move older figures to {page.parent.name}/details"
    if (page.parent / "details" / page.name).is_file() and f"(details/{page.name})" not in text:
        yield f"there is no link to details/{page.name}"


def index_faults(folder: Path, pages: list[Path]) -> Iterator[str]:
    """Yield what is wrong with the index."""
    sections = (folder / "index.md").read_text("utf-8").split("\n## ")
    first = _ROW.findall(sections[1]) if len(sections) > 1 else []
    if len(first) != FIRST:
        yield f"index.md: its first section lists {len(first)} pages, {FIRST} are allowed"
    rows = [row for section in sections[2:] for row in _ROW.findall(section)]
    for page in pages:
        title = page.read_text("utf-8").split("\n", 1)[0].partition(". ")[2]
        titles = [text for text, name in rows if name == page.name]
        if titles != [title]:
            yield f"index.md: list {page.name} once below a subject, as '{title}'"


def faults(folder: Path = FOLDER) -> list[str]:
    """Return what is wrong with the decisions of a folder, a line each."""
    pages = sorted(folder.glob("[0-9]*.md"))
    found = [f"{page.name}: {fault}" for page in pages for fault in page_faults(page)]
    lost = [page for page in (folder / "details").glob("*.md") if not (folder / page.name).is_file()]
    found += [f"details/{page.name}: there is no decision of this name" for page in lost]
    return [*found, *index_faults(folder, pages)]


def main() -> int:
    """Print what is wrong; return 1 if anything is."""
    found = faults()
    print("\n".join(found))
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
