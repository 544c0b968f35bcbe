"""Measures the English of docstrings and the names of functions, package by package: `make check` runs it.

Rules, with the values of codebases that read well beside them (measured on their sources, November 2026):

- Referring words (which, those, it, ...) are at most 3.5 % of the words of all docstrings of a package. They
  make a reader look back for the noun. mink has 1.1 %, httpx 1.8 %, dm_control 2.7 %.
- The docstring of an attribute begins with the name of its value ("Jaw opening, rad."), not with a
  preposition ("Of the jaw, rad.").
- The docstring of `__init__` does not begin with "Take": its arguments say so.
- At most 45 % of the distinct names of functions are a single word. mink has 42 %, httpx 46 %.

    python docs/tools/words.py [--list PACKAGE]
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = (
    *("configs", "controllers", "devices", "engines", "hub", "learning", "robots", "schemas", "tasks"),
    *("trocar", "webconsole"),
)
REFERRING = frozenset(
    {*("what", "which", "that", "who", "whose", "those", "one", "ones", "it", "its", "they", "them", "other")}
)
MAX_REFERRING = 0.035
PREPOSITIONS = ("Of", "By", "From", "As", "Between", "In")
MAX_ONE_WORD = 0.45

_Owner = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


@dataclass
class Words:
    """Words of the docstrings and names of the functions of one package."""

    total: int = 0
    referring: int = 0
    faults: list[str] = field(default_factory=list)
    names: set[str] = field(default_factory=set)

    @property
    def referring_share(self) -> float:
        """Share of referring words among the docstring words, 0 to 1."""
        return self.referring / max(self.total, 1)


def docstrings(tree: ast.Module) -> Iterator[tuple[int, str, ast.AST]]:
    """Yield line, text and owner of every docstring, those of attributes included."""
    for node in ast.walk(tree):
        if not isinstance(node, _Owner):
            continue
        for before, statement in zip([node, *node.body], node.body, strict=False):
            if not (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)):
                continue
            if isinstance(statement.value.value, str) and (
                before is node or isinstance(before, ast.Assign | ast.AnnAssign)
            ):
                yield statement.lineno, statement.value.value, before


def prose_words(text: str) -> list[str]:
    """Return the words of a docstring in lower case, without code in backticks."""
    return re.findall(r"[a-z]+(?:'[a-z]+)?", re.sub(r"`[^`]*`", " ", text).lower())


def count_referring(words: list[str]) -> int:
    """Return the number of referring words."""
    return sum(word in REFERRING for word in words)


def modules(package: str) -> Iterator[tuple[Path, ast.Module]]:
    """Yield path and syntax tree of each module of a package."""
    for file in sorted((ROOT / package).rglob("*.py")):
        yield file.relative_to(ROOT), ast.parse(file.read_text("utf-8"))


def measured(package: str) -> Words:
    """Return the words of a package."""
    words = Words()
    for where, tree in modules(package):
        for line, text, owner in docstrings(tree):
            found = prose_words(text)
            words.total += len(found)
            words.referring += count_referring(found)
            first = text.split(maxsplit=1)[0] if text.split() else ""
            if isinstance(owner, ast.Assign | ast.AnnAssign) and first in PREPOSITIONS:
                words.faults.append(f'{where}:{line}: an attribute begins with "{first}": name its value')
            if isinstance(owner, ast.FunctionDef) and owner.name == "__init__" and first == "Take":
                words.faults.append(f'{where}:{line}: `__init__` begins with "Take": leave it out')
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and not node.name.startswith("__"):
                words.names.add(node.name)
    return words


def densest(package: str) -> list[str]:
    """Return the modules of a package with the most referring words, the worst first."""
    rows: list[tuple[int, float, Path]] = []
    for where, tree in modules(package):
        found = [word for _, text, _ in docstrings(tree) for word in prose_words(text)]
        count = count_referring(found)
        rows.append((count, count / max(len(found), 1), where))
    return [f"{count:4} {share:6.1%} {where}" for count, share, where in sorted(rows, reverse=True) if count]


def main() -> int:
    """Print the table and the faults; return 1 if a rule is broken."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--list", metavar="PACKAGE", help="modules with the most referring words")
    chosen = parser.parse_args().list
    if chosen:
        print("\n".join(densest(chosen)))
        return 0
    broken: list[str] = []
    names: set[str] = set()
    print("package      docstring words  referring")
    for package in PACKAGES:
        words = measured(package)
        names |= words.names
        print(f"{package:12} {words.total:15} {words.referring_share:9.1%}")
        broken += words.faults
        if words.referring_share > MAX_REFERRING:
            broken.append(
                f"{package}: {words.referring_share:.1%} referring words, at most {MAX_REFERRING:.1%};"
                f" python docs/tools/words.py --list {package}"
            )
    single = sum("_" not in name.strip("_") for name in names) / len(names)
    print(f"function names of one word: {single:.1%} of {len(names)}")
    if single > MAX_ONE_WORD:
        broken.append(f"{single:.1%} of the function names are one word, at most {MAX_ONE_WORD:.0%}")
    print("\n".join(broken))
    return bool(broken)


if __name__ == "__main__":
    sys.exit(main())
