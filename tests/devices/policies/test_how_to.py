"""The page for strangers: its policy drives the arm, and `trocar policy` shows the contract."""

import json
import re
import sys
from pathlib import Path

import pytest

import trocar as public
from hub.command_line import main
from hub.planning.scenario_file import installed_scenarios

pytest.importorskip("ruckig")
pytest.importorskip("mujoco")

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "policies.md"


@pytest.fixture
def stranger(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code = re.search(r"```python\n(# mine\.py.*?)```", PAGE.read_text(), re.DOTALL)[1]
    (tmp_path / "mine.py").write_text(code)
    (tmp_path / "my.yaml").write_text(installed_scenarios()["policy"].read_text())
    return "participants.policy.backend=python:mine.py:hover"


@pytest.fixture
def trocar(monkeypatch, capsys):
    """Run `trocar ...` and return exit code, stdout and stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["trocar", *arguments])
        with pytest.raises(SystemExit) as left:
            main()
        return left.value.code or 0, *capsys.readouterr()

    return run


@pytest.mark.long
def test_a_strangers_policy_drives_the_arm(stranger):
    summary = public.run(
        "my.yaml", set=dict([stranger.split("=")], duration="1.5 s"), record="mine", one_host=True
    )
    assert summary.measures["faults"] == 0
    assert public.verify("mine").same
    end = public.Recording("mine")["motion.PSM1/measured_cp"]["position"][-1]
    assert end == pytest.approx([0.0, 0.0, -0.16], abs=1e-3)


def test_the_command_shows_the_contract_and_asks(stranger, trocar):
    code, out, _ = trocar("policy", "my.yaml", "--set", stranger, "--json")
    assert code == 0
    shown = json.loads(out)
    assert shown["action"][7] == "psm1_jaw_sp [rad]"
    assert shown["answers"]["rows of answers"] == "15 x 8"
    code, out, _ = trocar("policy", "my.yaml", "--ask", "0")
    assert (code, "psm1_pose.position.x" in out) == (0, True)


@pytest.mark.parametrize(
    ("scenario", "change", "said"),
    [
        ("my.yaml", "scene.contract.rate=20", "rate: the policy has 30.0, the contract 20.0"),
        ("palpation", "duration=1 s", "no participant is of kind policy"),
    ],
)
def test_what_does_not_fit_is_named(stranger, trocar, scenario, change, said):
    own = installed_scenarios()["policy"].parent / "data" / "policies" / "pick.py"
    own = f"participants.policy.backend=python:{own}:Pick" if scenario == "my.yaml" else change
    code, _, err = trocar("policy", scenario, "--set", own, "--set", change)
    assert code == 2
    assert said in err
