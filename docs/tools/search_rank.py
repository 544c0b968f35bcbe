"""Ranks decision pages below all others in the search of the site; a hook of MkDocs (mkdocs.yml)."""

from __future__ import annotations

from mkdocs.structure.pages import Page

DECISION_BOOST = 0.1
"""Factor on the score of a decision page; 1 is that of any other page."""


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Set the rank of a decision; pages of details are not searched."""
    if page.file.src_uri.startswith("decisions/details/"):
        page.meta["search"] = {"exclude": True}
    elif page.file.src_uri.startswith("decisions/"):
        page.meta["search"] = {"boost": DECISION_BOOST}
    return markdown
