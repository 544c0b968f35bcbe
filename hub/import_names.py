"""Whether Trocar's import names, some of these generic words, belong to Trocar in this environment."""

from __future__ import annotations

import hashlib
from base64 import urlsafe_b64encode
from dataclasses import dataclass
from importlib.metadata import PackagePath, distributions
from importlib.util import find_spec
from pathlib import Path

__all__ = ["NAMES", "Collision", "import_collisions"]

NAMES = (
    "trocar",
    "schemas",
    "robots",
    "anatomy",
    "hub",
    "engines",
    "controllers",
    "devices",
    "tasks",
    "learning",
    "webconsole",
    "configs",
)
"""The top-level packages of the distribution `trocar`."""

_ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Collision:
    """An import name of Trocar shared with another distribution, or with another folder on the path."""

    name: str
    others: tuple[str, ...]
    """Distributions with a module of the same name."""
    file: str
    """The imported file."""
    owner: str
    """The distribution of this file; empty if none."""


def import_collisions() -> list[Collision]:
    """Return the import names not owned by Trocar alone."""
    owners = _owners()
    found: list[Collision] = []
    for name in NAMES:
        spec = find_spec(name)
        file = Path((spec and spec.origin) or _ROOT / name / "__init__.py").resolve()
        others = {other: files for other, files in owners.get(name, {}).items() if other != "trocar"}
        if others or file.parent != _ROOT / name:
            owner = next((other for other, files in others.items() if _is_from(file, files)), "")
            if not owner and file.parent == _ROOT / name:
                owner = "trocar"
            found.append(Collision(name, tuple(sorted(others)), str(file), owner))
    return found


def _owners() -> dict[str, dict[str, list[PackagePath]]]:
    """Return the distributions of each import name, each with the files of the name."""
    owners: dict[str, dict[str, list[PackagePath]]] = {}
    for distribution in distributions():
        for file in distribution.files or ():
            name = file.parts[0].removesuffix(".py")
            if name in NAMES:
                owners.setdefault(name, {}).setdefault(distribution.name, []).append(file)
    return owners


def _is_from(file: Path, files: list[PackagePath]) -> bool:
    """Return whether `file` is one of `files`, by place and by the hash recorded in the distribution."""
    if not file.is_file():
        return False
    digest = urlsafe_b64encode(hashlib.sha256(file.read_bytes()).digest()).rstrip(b"=").decode()
    return any(
        Path(str(known.locate())).resolve() == file and known.hash is not None and known.hash.value == digest
        for known in files
    )
