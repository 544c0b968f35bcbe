"""A hand at a stylus, and what the instrument touches: whole sessions, with the way between hand and robot as
long as half the world.
"""

import json
from collections.abc import Iterable
from copy import deepcopy
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from devices.simulated_touch.device import SimulatedTouch
from hub.participant import Sample
from hub.planning.scenario_file import load
from hub.session.launch import in_one_host, plan_of
from hub.session.session import Session
from schemas.ros import PoseStamped, WrenchStamped

PATH = [
    {"at": 0, "position": [0, 0, 0]},
    {"at": 0.1, "buttons": [0]},
    {"at": 1.8, "position": [0, 0, 0]},
    {"at": 2.4, "position": [0, 0, -0.0325]},
]
TABLE = {
    "name": "table",
    "step": "2 ms",
    "duration": "4 s",
    "pace": "fast",
    "participants": {
        "console": {"kind": "simulated-touch", "styluses": {"right": {"path": PATH}}},
        "teleop": {
            "kind": "teleoperation",
            "period": "4 ms",
            "scale": 1.0,
            "engage": "held",
            "contact_period": "4 ms",
            "planes": [{"normal": [0, 0, 1], "distance": "-136 mm", "stiffness": "200 N/m"}],
        },
    },
    "connections": [
        "console.right/pose -> teleop.master",
        "console.right/buttons -> teleop.buttons",
        "teleop.contact -> console.right/contact",
    ],
}
"""The paper's table: 200 N/m, 22.5 mm below where the tip starts; the hand wants to be 10 mm below that.

It is felt where the tip is told to be.
"""


class Felt(NamedTuple):
    """What the hand did and felt, at every communication point."""

    time: np.ndarray
    height: np.ndarray
    force: np.ndarray
    """Norm, N."""

    def last_second(self) -> float:
        """Motion of the hand in the last second, peak to peak, mm."""
        return float(np.ptp(self.height[self.time > self.time[-1] - 1.0])) * 1e3


def _run(scenario: dict, file: Path, link: dict) -> Felt:
    """Run a session in this process, and listen at the hand's side of the link."""
    scenario["participants"]["console"]["network_link"] = link
    file.write_text(json.dumps(scenario))
    loaded = load(str(file))
    checked = in_one_host(loaded.scenario)
    plan, participants = plan_of(checked, loaded.params)
    console = participants["console"]
    assert isinstance(console, SimulatedTouch)
    rows: list[tuple[float, float, float]] = []
    read = console.read

    def listen(t: int) -> Iterable[Sample]:
        samples = read(t)
        messages = {sample.port: sample.message for sample in samples}
        pose, wrench = messages["right/pose"], messages["right/force"]
        assert isinstance(pose, PoseStamped)
        assert isinstance(wrench, WrenchStamped)
        force = wrench.wrench.force
        rows.append((t * 1e-9, pose.pose.position.z, float(np.linalg.norm([force.x, force.y, force.z]))))
        return samples

    console.read = listen
    assert Session(checked, plan, participants, file.parent, endpoint="tcp/127.0.0.1:0").run().state == "done"
    return Felt(*np.array(rows).T)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "scenario.yaml"


@pytest.mark.parametrize(
    "link",
    [{}, {"preset": "100 ms", "jitter": "20 ms"}, {"preset": "300 ms", "jitter": "50 ms", "loss": 0.1}],
    ids=lambda link: link.get("preset", "0 ms"),
)
def test_a_hand_on_the_virtual_table_comes_to_rest_whatever_the_delay(file: Path, link: dict) -> None:
    felt = _run(deepcopy(TABLE), file, link)
    assert felt.last_second() < 1.0
    assert felt.height[-1] == pytest.approx(-0.0275, abs=2e-4)  # table and grip have the same stiffness
    assert felt.force[-1] == pytest.approx(1.0, abs=0.02)


@pytest.mark.long
def test_a_link_that_drops_ends_the_force_within_150_ms_and_the_arm_waits_for_the_button(file: Path) -> None:
    scenario = deepcopy(TABLE) | {"step": "1 ms"}
    felt = _run(scenario, file, {"preset": "70 ms", "outages": [{"at": "3 s", "duration": "300 ms"}]})
    # models are under way for 70 ms
    pressed, silent = felt.force[felt.time == 3.0], felt.force[(felt.time >= 3.22) & (felt.time < 3.3)]
    assert pressed == pytest.approx(1.0, abs=0.05)
    assert not silent.any()
    assert np.diff(felt.force).max() <= 0.1 + 1e-9
    # the arm has been without a hand: the clutch button is to be pressed anew
    assert not felt.force[felt.time > 3.3].any()


def test_a_session_through_a_bad_link_gives_the_same_bits_again(file: Path) -> None:
    link = {"delay": "20 ms", "jitter": "30 ms", "loss": 0.3, "seed": 7}
    scenario = deepcopy(TABLE) | {"duration": "2.5 s"}
    one, two = (_run(scenario, file, link) for _ in range(2))
    assert np.array_equal(one, two)
    assert one.force.any()


TISSUE = {
    "robot": {
        "kind": "mujoco",
        "looks": False,
        "publish_period": "20 ms",
        "arms": {
            "PSM1": {"instrument": "palpation-probe", "probe_radius": "5 mm", "position": [0, 0, "123.5 mm"]}
        },
    },
    "teleop": {
        "kind": "teleoperation",
        "period": "4 ms",
        "scale": 0.5,
        "engage": "held",
        "contact_period": "4 ms",
    },
    "tissue": {
        "kind": "bullet",
        "organs": {"block": {"size": ["60 mm", "60 mm", "20 mm"], "young_modulus": "10 kPa", "nodes": 100}},
        "probes": {"probe": {"radius": "5 mm"}},
    },
}


@pytest.mark.long
def test_a_hand_on_tissue_comes_to_rest_behind_a_satellite(file: Path) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("pybullet")
    scenario = deepcopy(TABLE) | {"duration": "4.5 s", "order": ["teleop", "robot", "tissue"]}
    scenario["participants"] |= TISSUE
    scenario["connections"] += [
        "robot.PSM1/tip_wrench -> teleop.tip_wrench",
        {"source": "teleop.servo_jp", "target": "robot.PSM1/servo_jp", "extrapolation": "linear"},
    ]
    scenario["bonds"] = [{"motion": "robot.PSM1/probe", "force": "tissue.probe", "algorithm": "impulse"}]
    felt = _run(scenario, file, {"preset": "300 ms", "jitter": "20 ms", "loss": 0.05})
    assert felt.last_second() < 1.0
    assert felt.force[-1] > 0.3
    settled = felt.height[felt.time > 3.5]
    assert abs(settled[-1] - settled[0]) < 1e-3
