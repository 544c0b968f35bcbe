"""The table of the scenario `ros` is out of reach of an arm that turns at the insertion of home."""

from math import hypot

import pytest
import yaml

from hub.planning.scenario_file import installed_scenarios, load
from hub.session.launch import launch

pytest.importorskip("mujoco")
pytest.importorskip("ruckig")

CONNECTIONS = [
    "routine.* -> motion.*",
    "motion.* -> routine.*",
    "motion.drive/* -> robot.*",
    "robot.* -> motion.sense/*",
]


@pytest.mark.long
def test_psm1_turns_by_0_2_rad_above_the_table(tmp_path):
    """The norm of all joint positions at the end is that of the goal: no joint is held back."""
    scenario = yaml.safe_load(installed_scenarios()["ros"].read_text())
    steps = [
        {"do": "state", "arm": "PSM1", "command": "home"},
        {"do": "move_jp", "arm": "PSM1", "positions": [0.2, 0, 0.12, 0, 0, 0]},
    ]
    parts = {"motion": scenario["participants"]["motion"], "robot": scenario["participants"]["robot"]}
    parts["routine"] = {"kind": "routine", "steps": steps}
    scenario |= {"participants": parts, "order": ["routine", "motion", "robot"], "connections": CONNECTIONS}
    scenario |= {"pace": "fast", "duration": "3 s"}
    scenario["measure"] = {"reached": {"kind": "final", "of": "motion.PSM1/measured_js.position"}}
    (tmp_path / "turn.yaml").write_text(yaml.safe_dump(scenario))
    summary = launch(load(str(tmp_path / "turn.yaml"), []), endpoint="tcp/127.0.0.1:0", one_host=True).run()
    assert summary.measures["reached"] == pytest.approx(hypot(0.2, 0.12), abs=2e-3)
