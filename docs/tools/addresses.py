"""Checks the addresses of the project itself: `make check` runs `python docs/tools/addresses.py`.

The project has no public address yet. `[project.urls]` of pyproject.toml has a placeholder below `.invalid`,
a domain that cannot exist (RFC 2606). Until the placeholder is replaced there, no file may name an address
with "trocar" in it: it would be made up. Afterwards such addresses begin with the one of `[project.urls]`.

    python docs/tools/addresses.py --release v0.2.0

also refuses the placeholder, and a version that differs in pyproject.toml, CITATION.cff or CHANGELOG.md.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PLACEHOLDER = "https://trocar.invalid"
_ADDRESS = re.compile(r"""https?://[^\s)"'`<>\]]+""")
_SUFFIXES = {".md", ".toml", ".cff", ".yml", ".yaml", ".json", ".py", ".html", ".js", ""}


def home(root: Path) -> str:
    """Return the address that all of `[project.urls]` begin with: that of Homepage."""
    return tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["project"]["urls"]["Homepage"]


def address_faults(root: Path, names: list[str]) -> list[str]:
    """Return the addresses in these files that name the project and do not begin with its home."""
    start = home(root)
    found: list[str] = []
    for name in names:
        path = root / name
        if path.suffix not in _SUFFIXES or not path.is_file():
            continue
        for number, line in enumerate(path.read_text("utf-8", errors="replace").splitlines(), 1):
            found += [
                f"{name}:{number}: {address} does not begin with {start} of [project.urls]"
                for address in _ADDRESS.findall(line)
                if "trocar" in address.lower() and not address.startswith(start)
            ]
    return found


def release_faults(root: Path, tag: str) -> list[str]:
    """Return what keeps the project from being released as version `tag`, such as v0.2.0."""
    project = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["project"]
    version = tag.removeprefix("v")
    found = [
        f"pyproject.toml: {name} = {address}: replace the placeholder"
        for name, address in project["urls"].items()
        if address.startswith(PLACEHOLDER)
    ]
    if project["version"] != version:
        found.append(f"pyproject.toml: version {project['version']}, the tag is {tag}")
    if f"\nversion: {version}\n" not in (root / "CITATION.cff").read_text("utf-8"):
        found.append(f"CITATION.cff: the version is not {version}")
    if f"\n## [{version}]" not in (root / "CHANGELOG.md").read_text("utf-8"):
        found.append(f"CHANGELOG.md: there is no heading [{version}]")
    return found


def tracked_files(root: Path) -> list[str]:
    """Return the files that git knows or would add."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    return subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout.splitlines()


def main() -> int:
    """Print what is wrong; return 1 if anything is."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--release", metavar="TAG", help="check also what a release needs")
    tag = parser.parse_args().release
    names = [name for name in tracked_files(ROOT) if not name.endswith("test_addresses.py")]
    found = address_faults(ROOT, names) + (release_faults(ROOT, tag) if tag else [])
    print("\n".join(found))
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
