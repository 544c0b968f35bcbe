"""`docs/tools/addresses.py` finds made-up addresses, and refuses a release with the placeholder."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
_spec = importlib.util.spec_from_file_location("addresses", ROOT / "docs" / "tools" / "addresses.py")
addresses = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(addresses)


def project(folder, home):
    """Write a project of version 0.3.0 at this address."""
    (folder / "pyproject.toml").write_text(
        f'[project]\nversion = "0.3.0"\n[project.urls]\nHomepage = "{home}"\nIssues = "{home}/issues"\n'
    )
    (folder / "CITATION.cff").write_text("title: T\nversion: 0.3.0\n")
    (folder / "CHANGELOG.md").write_text("# Changelog\n\n## [0.3.0]\n")


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("see https://trocar.invalid/issues and https://docs.python.org", 0),
        ("see https://github.com/someone/trocar", 1),
        ("https://Trocar.example.org and https://pypi.org/project/trocar/", 2),
    ],
)
def test_an_address_of_the_project_is_the_one_it_states(tmp_path, text, count):
    project(tmp_path, "https://trocar.invalid")
    (tmp_path / "README.md").write_text(text)
    assert len(addresses.address_faults(tmp_path, ["README.md", "gone.md"])) == count


def test_a_release_needs_an_address_and_one_version(tmp_path):
    project(tmp_path, "https://trocar.invalid")
    assert [fault.split(":")[0] for fault in addresses.release_faults(tmp_path, "v0.3.0")] == [
        "pyproject.toml",
        "pyproject.toml",
    ]
    project(tmp_path, "https://host.example/trocar")
    assert not addresses.release_faults(tmp_path, "v0.3.0")
    assert len(addresses.release_faults(tmp_path, "v0.4.0")) == 3


def test_this_project_has_the_placeholder_or_an_address_of_its_own():
    home = addresses.home(ROOT)
    assert home == addresses.PLACEHOLDER or re.match(
        r"https://[\w.-]+\.(?!invalid|example|test)\w+(/|$)", home
    )
    files = ["README.md", "CHANGELOG.md", "CITATION.cff", "mkdocs.yml", "pyproject.toml"]
    assert addresses.address_faults(ROOT, files) == []
