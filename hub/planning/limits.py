"""The upper limits of a scenario, so that any file is accepted or rejected within seconds.

The largest of Trocar's own scenarios has 4.5 kB, 300 values and 6 levels. A value takes about 40 us to parse,
so the limits keep the time of reading below 2 s and the memory below 50 MB.
"""

from __future__ import annotations

__all__ = [
    "MAX_BYTES",
    "MAX_DEPTH",
    "MAX_ITEMS",
    "MAX_KIND",
    "MAX_NUMBER",
    "MAX_PARTICIPANTS",
    "MAX_PROBLEMS",
    "MAX_SCENE_VALUES",
    "MAX_TEXT",
    "MAX_VALUES",
    "safe_text",
]

MAX_BYTES = 512 * 1024
"""Bytes of the file with comments: room for `MAX_PARTICIPANTS` of 500 bytes each."""

MAX_DEPTH = 32
"""Levels of nested mappings and lists: the reader, the validation and the messages recurse."""

MAX_VALUES = 20_000
"""Keys and values of the file, with aliases (`*name`) written out: 0.8 s to parse."""

MAX_ITEMS = 5_000
"""Items of a list or mapping: five connections for each of `MAX_PARTICIPANTS`."""

MAX_TEXT = 4_096
"""Characters of a text: the longest path on Linux (PATH_MAX)."""

MAX_NUMBER = 80
"""Characters of a number: a binary integer of 64 bits takes 66, a float 24."""

MAX_PARTICIPANTS = 1_000
"""Participants of a session: `trocar check` of a chain of 1000 takes about 5 s."""

MAX_SCENE_VALUES = 100_000
"""Values copied from `scene` to all participants together: each participant validates its own copy."""

MAX_KIND = 200
"""Characters of the name of a kind, with the name of the module."""

MAX_PROBLEMS = 20
"""Problems reported at once: each takes a search for similar names, and the first often cause the rest."""


def safe_text(text: str, length: int = 200) -> str:
    """Return `text` for a message: shortened to about `length` characters, and printable on any terminal."""
    if len(text) > length:
        half = length // 2
        text = f"{text[:half]}... ({len(text)} characters) ...{text[-half:]}"
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)
