"""The pages for beginners are programs: every block on them is run, and prints what the page says."""

from pathlib import Path

import pytest

from tests.docs.tutorial import Runner, blocks

DOCS = Path(__file__).parents[2] / "docs"
PAGES = [DOCS / "start.md", *sorted((DOCS / "tutorials").glob("*.md"))]


@pytest.mark.release
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_its_blocks_run_and_print_what_it_says(page, tmp_path):
    assert Runner(page, tmp_path).run()


def test_what_is_not_run_has_a_reason():
    for block in (block for page in PAGES for block in blocks(page)):
        assert block.language in {"console", "python", "yaml", "toml", "text"}, block
        assert not block.skip or len(block.skip) > 8, block
