"""A hand feels through a whole session what the robot touches: the installed scene of the virtual table, and
a table that is there.
"""

import json

import pytest

from hub.planning.scenario_file import installed_scenarios, load
from hub.session.launch import launch

pytest.importorskip("mujoco")


def run(file):
    session = launch(load(str(file)), endpoint="tcp/127.0.0.1:0", one_host=True)
    summary = session.run()
    assert summary.state == "done"
    return summary.measures


def test_the_virtual_table_pushes_with_200_n_per_m(tmp_path):
    """It shares the way of 7.5 mm with the grip, which is as stiff.

    The scene ends early here, before the hand rubs.
    """
    file = tmp_path / "table.yaml"
    text = installed_scenarios()["table"].read_text()
    file.write_text(text.replace("duration: 10 s", "duration: 3.6 s").replace("after: 9 s", "after: 3.2 s"))
    measures = run(file)
    assert measures["peak_hand_force_n"] == pytest.approx(0.75, abs=0.02)
    assert measures["lowest_tip_m"] == pytest.approx(-0.136 - 0.00375, abs=2e-4)
    assert measures["seconds_in_contact"] > 0.8
    assert measures["hand_swing_at_the_end_m"] < 1e-3


def test_a_rigid_table_is_felt_through_a_link_and_the_hand_rests_on_it(tmp_path):
    """The table is 12.5 mm below the probe, 25 mm of the hand, which presses 5 mm on; of those the grip takes
    two thirds, being half as stiff as 400 N/m.
    """
    path = [
        {"at": 0, "position": [0, 0, 0]},
        {"at": 0.1, "buttons": [0]},
        {"at": 1.6, "position": [0, 0, -0.03]},
    ]
    scenario = {
        "name": "rigid_table",
        "step": "1 ms",
        "window": 4,
        "duration": "3.2 s",
        "participants": {
            "stylus": {
                "kind": "simulated-touch",
                "period": "4 ms",
                "styluses": {"right": {"path": path}},
                "network_link": {"preset": "100 ms"},
            },
            "teleop": {"kind": "teleoperation", "period": "4 ms", "engage": "held", "scale": 0.5},
            "robot": {
                "kind": "mujoco",
                "looks": False,
                "table": {"position": [0, 0, 0]},
                "arms": {
                    "PSM1": {
                        "instrument": "palpation-probe",
                        "probe_radius": "5 mm",
                        "position": [0, 0, "131 mm"],
                    }
                },
            },
        },
        "order": ["teleop", "robot"],
        "connections": [
            "stylus.right/pose -> teleop.master",
            "stylus.right/buttons -> teleop.buttons",
            "robot.PSM1/measured_js -> teleop.measured_js",
            "robot.PSM1/rigid_wrench -> teleop.rigid_wrench",
            {"source": "teleop.servo_jp", "target": "robot.PSM1/servo_jp", "extrapolation": "linear"},
            "teleop.contact -> stylus.right/contact",
        ],
        "measure": {
            "force": {"kind": "final", "of": "stylus.right/force.force"},
            "felt": {"kind": "final", "of": "robot.PSM1/rigid_wrench.force"},
            "swing": {"kind": "swing", "of": "stylus.right/pose.position", "after": "2.7 s"},
        },
    }
    file = tmp_path / "rigid_table.yaml"
    file.write_text(json.dumps(scenario))
    measures = run(file)
    assert measures["force"] == pytest.approx(400.0 * 0.005 / 3.0, rel=0.15)
    assert measures["felt"] > 2.0
    assert measures["swing"] < 1e-3
