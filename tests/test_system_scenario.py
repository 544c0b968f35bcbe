"""A whole dVRK in one scene: masters are aligned by their motors, then lead the instruments."""

from pathlib import Path

import pytest
import yaml

from hub.planning.scenario_file import load
from hub.session.launch import launch, plan_of

pytest.importorskip("mujoco")

CAMERAS = ("endoscope", "room")


@pytest.mark.long
def test_styluses_lead_instruments_through_aligned_masters(tmp_path: Path) -> None:
    scenario = yaml.safe_load(Path("configs/system.yaml").read_text("utf-8"))
    for camera in CAMERAS:
        del scenario["participants"][camera]
    scenario["connections"] = [line for line in scenario["connections"] if not line.endswith(".qpos")]
    start = [0, 0, 0]
    path = [
        {"at": "0 s", "position": start},
        {"at": "0.5 s", "buttons": [0]},
        {"at": "2.9 s", "position": start},
        {"at": "3.5 s", "position": [0, 0.02, 0]},
    ]
    scenario["participants"]["lead"]["styluses"] = {"right": {"path": path}, "left": {"path": path[:2]}}
    swings = {
        name: {"kind": "swing", "after": "2.8 s", "of": f"motion.{arm}/measured_cp.position"}
        for name, arm in (("led", "PSM1"), ("rests", "PSM3"))
    }
    scenario |= {"duration": "3.6 s", "measure": swings}
    (file := tmp_path / "system.yaml").write_text(yaml.safe_dump(scenario))
    summary = launch(load(str(file)), endpoint="tcp/127.0.0.1:0", one_host=True).run()
    assert summary.state == "done"
    assert 2.5e-3 < summary.measures["led"] < 5e-3  # 20 mm of the hand, scaled by 0.2
    assert summary.measures["rests"] < 1e-4


@pytest.mark.parametrize(
    "lead",
    [
        "{kind: browser-pair, host: remote}",
        "{kind: touch, styluses: {right: {device: right}, left: {device: left}}}",
    ],
)
def test_one_setting_lets_a_page_or_styluses_lead_both_hands(lead: str) -> None:
    loaded = load("system", [f"participants.lead={lead}"])
    plan, _ = plan_of(loaded.scenario, loaded.params)
    led = {(one.source_port, one.target) for one in plan.from_devices if one.source == "lead"}
    for side in ("right", "left"):
        assert {(f"{side}/pose", f"{side}_hand"), (f"{side}/buttons", f"{side}_hand")} <= led


def test_what_is_measured_of_a_master_reaches_the_drives_in_the_same_step() -> None:
    loaded = load("system")
    plan, _ = plan_of(loaded.scenario, loaded.params)
    fresh = {
        (f"{one.source}.{one.source_port}", f"{one.target}.{one.target_port}"): one.fresh
        for one in plan.connections
    }
    for way in (
        ("masters.MTMR/measured_cp", "right.master"),
        ("right.PSM1/servo_jp", "motion.PSM1/servo_jp"),
        ("motion.drive/PSM1/servo_jp", "robot.PSM1/servo_jp"),
    ):
        assert fresh[way], way
