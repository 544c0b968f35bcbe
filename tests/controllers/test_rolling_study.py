import json

import pytest
from typer.testing import CliRunner

from controllers.command_line import app
from controllers.rolling_study import RollingStudy, RollingStudyParams
from hub.participant import Setup
from hub.testing import check_engine
from robots.dvrk import stitch
from robots.dvrk.stitch_study import study

H = 1_000_000
FEW = stitch.lattice()[::29]


@pytest.fixture(autouse=True)
def _few_stitches(monkeypatch):
    monkeypatch.setattr(stitch, "lattice", lambda: FEW)


def make():
    return RollingStudy("study", RollingStudyParams())


def test_a_study_keeps_a_participants_contract():
    check_engine(make, period_ns=H)


def test_its_shares_are_outputs_from_time_0_on(tmp_path):
    with make() as participant:
        outputs = participant.configure(Setup(period_ns=H, directory=tmp_path))
        assert {name: float(value[0]) for name, value in outputs.items()} == study().shares()


def test_the_command_says_what_the_library_says(tmp_path):
    done = CliRunner().invoke(app, ["rolling", "--json", "--plot", str(tmp_path / "shares.png")])
    assert done.exit_code == 0, done.output
    found, made = json.loads(done.stdout), study()
    assert found["stitches"] == len(FEW)
    assert {name: found[name] for name in made.shares()} == made.shares()
    assert found["only_by_rolling_share"] == pytest.approx(
        found["feasible_share"] - found["feasible_share_without"]
    )
    assert (
        max(found["by_grasp_deg"].values())
        == found["feasible_share_without"]
        == found["by_grasp_deg"][f"{found['grasp_without_deg']:.6g}"]
    )
    assert (tmp_path / "shares.png").read_bytes().startswith(b"\x89PNG")


def test_the_command_for_people():
    done = CliRunner().invoke(app, ["rolling"])
    assert done.exit_code == 0
    assert f"Share of {len(FEW)} stitches" in done.stdout
    assert "60 deg tilt" in done.stdout


def test_a_plot_that_is_no_picture():
    done = CliRunner().invoke(app, ["rolling", "--plot", "shares.txt"])
    assert done.exit_code == 2
