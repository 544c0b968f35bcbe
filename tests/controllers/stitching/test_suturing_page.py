"""The sessions of docs/how-to/suturing.md, as the page writes them."""

import re
import shlex
from pathlib import Path

import pytest

import trocar

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "suturing.md"
RUN = "trocar run suturing"


def commands():
    """Return the overrides of each `trocar run suturing` of the page."""
    blocks = re.findall(r"```console\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    lines = [line for block in blocks for line in block.replace("\\\n", "").splitlines()]
    runs = [shlex.split(line[2:], comments=True) for line in lines if line.startswith(f"$ {RUN} ")]
    return [dict(word.split("=", 1) for word in words if "=" in word) for words in runs]


def test_the_page_has_commands():
    assert len(commands()) >= 7
    assert {"scene.fixtures.phantom.phantom": "src-straight"}.items() <= commands()[2].items()


@pytest.mark.parametrize("overrides", commands(), ids=str)
def test_a_session_of_the_page_is_valid(overrides):
    assert trocar.load_scenario("suturing", set=overrides).scenario.name == "suturing"


@pytest.mark.release
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("overrides", commands(), ids=str)
def test_a_session_of_the_page_makes_all_its_stitches(overrides):
    summary = trocar.run("suturing", set=overrides, one_host=True)
    assert summary.ending is not None
    assert "all stitches are made" in str(summary.ending)
