"""A whole dVRK in one scene: masters are aligned by their motors, then lead the instruments."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from robots import rotation

pytest.importorskip("mujoco")

CAMERAS = ("endoscope", "room")
SCALE = 0.2


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
        name: {"kind": "swing", "after": "2.8 s", "of": f"{port}.position"}
        for name, port in (("led", "motion.PSM1/measured_cp"), ("rests", "motion.PSM3/measured_cp"))
    }
    scenario |= {"duration": "3.6 s", "measure": swings}
    (file := tmp_path / "system.yaml").write_text(yaml.safe_dump(scenario))
    record = tmp_path / "recording"
    summary = launch(load(str(file)), endpoint="tcp/127.0.0.1:0", one_host=True, record=record).run()
    assert summary.state == "done"
    assert 2.5e-3 < summary.measures["led"] < 5e-3  # 20 mm of the hand, scaled by 0.2
    assert summary.measures["rests"] < 1e-4
    away, turned = following_errors(Recording(record), 2.8)
    assert away < 1e-6
    assert turned < np.radians(0.01)


def following_errors(recording: Recording, since: float) -> tuple[float, float]:
    """Largest distance (m) and angle (rad) of the tip's setpoint from the goal of the master at that time."""
    tips, masters = recording["motion.PSM1/setpoint_cp"], recording["masters.MTMR/measured_cp"]
    master = masters.values[np.isin(masters.time, tips.time[tips.time >= since])]
    tip = tips.values[tips.time >= since]
    assert len(tip) == len(master) > 50
    away = tip[:, :3] - tip[0, :3] - SCALE * (master[:, :3] - master[0, :3])
    offsets = [
        rotation.product(rotation.conjugate(one[3:]), other[3:])
        for one, other in zip(master, tip, strict=True)
    ]
    turns = [rotation.log(rotation.product(rotation.conjugate(offsets[0]), one)) for one in offsets]
    return float(np.linalg.norm(away, axis=1).max()), float(np.linalg.norm(turns, axis=1).max())
