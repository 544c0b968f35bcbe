"""`trocar identify` reads what tools record, and says what a recording lacks."""

import os
import subprocess
import sys

import numpy as np
import pytest
from typer.testing import CliRunner

import trocar
from learning.identification.command_line import app
from learning.identification.measurements import has_jaw, measurements
from robots.dvrk import arm_bodies
from robots.dvrk.instruments import instrument
from robots.dvrk.mounted.mounted_psm import MountedPsm
from robots.dvrk.own_dynamics import OwnDynamics
from robots.identification import excitation
from schemas.errors import RecordingError
from trocar import write_bag
from trocar.messages import JointState

JOINTS = ("yaw", "pitch")


def test_a_table_has_its_columns_in_any_order(tmp_path):
    file = tmp_path / "own.csv"
    file.write_text(
        "effort.yaw,time,position.pitch,position.yaw,effort.pitch\n5,0,2,1,6\n7,0.1,4,3,8\n", "utf-8"
    )
    measured = measurements(file, "PSM1", JOINTS)
    assert measured.time.tolist() == [0.0, 0.1]
    assert measured.position.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert measured.effort.tolist() == [[5.0, 6.0], [7.0, 8.0]]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("time,position.yaw,position.pitch,effort.yaw\n0,1,2,3\n", "no column 'effort.pitch'"),
        ("time,position.yaw\n0,fast\n", "not a table of numbers"),
        ("", "no column 'time'"),
        ("a,b\n1,2,3,4\n5,6,7,8\n", "line 2 has 4 numbers, the first line 2 names"),
        ("a,b\n1,2\n3\n", "line 3 has 1 numbers"),
        ("a,b\n" + "1" * 200_000 + ",2\n", "field larger than field limit"),
        ("a,b\n\0,2\n", "not a table of numbers"),
    ],
)
def test_a_table_that_lacks_something_is_refused(tmp_path, text, reason):
    file = tmp_path / "own.csv"
    file.write_text(text, "utf-8")
    with pytest.raises(RecordingError, match=reason):
        measurements(file, "PSM1", JOINTS)


def test_dynamics_of_another_kind_of_instrument_are_refused(tmp_path):
    (tmp_path / "psm.yaml").write_text("{instrument: X, bodies: {}, joints: {}, discs: []}", "utf-8")
    with pytest.raises(ValueError, match=r"was identified with X.*identify it with what it holds"):
        MountedPsm.model_validate({"dynamics": "psm.yaml"}, context={"directory": tmp_path})


def test_a_file_that_is_missing_is_refused(tmp_path):
    with pytest.raises(ValueError, match="cannot read"):
        MountedPsm.model_validate({"dynamics": "none.yaml"}, context={"directory": tmp_path})


def test_a_bag_has_one_such_topic(tmp_path):
    states = [JointState(name=list(JOINTS), position=[i, 2.0 * i], effort=[3.0, 4.0]) for i in (0.0, 1.0)]
    write_bag(tmp_path / "bag", [("/PSM1/measured_js", i * 10_000_000, one) for i, one in enumerate(states)])
    measured = measurements(tmp_path / "bag", "PSM1", JOINTS)
    assert measured.time == pytest.approx([0.0, 0.01])
    assert measured.position.tolist() == [[0.0, 0.0], [1.0, 2.0]]
    assert np.array_equal(measured.effort, [[3.0, 4.0]] * 2)
    with pytest.raises(RecordingError, match="no topics that end in 'PSM2/measured_js'"):
        measurements(tmp_path / "bag", "PSM2", JOINTS)
    with pytest.raises(RecordingError, match="2 positions and 2 efforts, 3"):
        measurements(tmp_path / "bag", "PSM1", (*JOINTS, "insertion"))


def test_the_topic_with_the_most_messages_is_read(tmp_path):
    states = [JointState(name=list(JOINTS), position=[i, 0.0], effort=[3.0, 4.0]) for i in (0.0, 1.0, 2.0)]
    rows = [("/robot/PSM1/measured_js", i * 10_000_000, one) for i, one in enumerate(states)]
    write_bag(tmp_path / "bag", [*rows, ("/motion/PSM1/measured_js", 0, states[2])])
    assert measurements(tmp_path / "bag", "PSM1", JOINTS).position[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert measurements(tmp_path / "bag", "PSM1", JOINTS, "motion").position[:, 0].tolist() == [2.0]


def test_whose_states_count_is_an_option(tmp_path):
    states = JointState(name=list(JOINTS), position=[0.0, 0.0], effort=[3.0, 4.0])
    write_bag(tmp_path / "bag", [("/robot/PSM1/measured_js", 0, states)])
    words = [str(tmp_path / "bag"), "-o", "never.yaml"]
    assert "has 2 positions" in str(CliRunner().invoke(app, [*words, "--of", "robot"]).exception)
    failed = str(CliRunner().invoke(app, [*words, "--of", "real"]).exception)
    assert "no topics that end in 'real/PSM1/measured_js'" in failed


@pytest.mark.long
def test_the_command_computes_alike_on_every_machine():
    """Threads and kernels are set before numpy is imported; what imports it later cannot change them."""
    script = """
import os, sys
class Watch:
    def find_spec(self, name, path, target=None):
        if name == "numpy":
            print(os.environ["OPENBLAS_NUM_THREADS"])
sys.meta_path.insert(0, Watch())
import hub.command_line
import robots.identification.fit
"""
    environment = {key: value for key, value in os.environ.items() if "_NUM_THREADS" not in key}
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["1"]


def test_the_jaw_is_read_at_the_times_of_the_joints(tmp_path):
    rows = [
        (topic, time * 1_000_000, JointState(name=names, position=[p] * len(names), effort=[p] * len(names)))
        for time, p in ((0, 0.0), (10, 1.0), (20, 2.0))
        for topic, names in (("/PSM1/measured_js", list(JOINTS)), ("/PSM1/jaw/measured_js", ["jaw"]))
    ]
    write_bag(tmp_path / "bag", rows)
    assert has_jaw(tmp_path / "bag", "PSM1")
    assert measurements(tmp_path / "bag", "PSM1", (*JOINTS, "jaw")).position[:, 2].tolist() == [0.0, 1.0, 2.0]
    assert not has_jaw(tmp_path / "bag", "PSM2")


def test_a_motion_or_recordings_are_asked_for():
    for arguments in ((), ("--excite", __file__)):
        result = CliRunner().invoke(app, [*arguments, "-o", "never.yaml"])
        assert result.exit_code == 2
        assert "--excite" in result.output


@pytest.mark.alone
def test_the_whole_circle(tmp_path, monkeypatch):
    """Excite, run, identify: the weight and the friction of the simulated arm are found."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(excitation, "_TRIES", 10)
    monkeypatch.setattr(excitation, "_ITERATIONS", 0)
    done = CliRunner().invoke(app, ["--excite", "--periods", "1", "-o", "motion"])
    assert done.exit_code == 0, done.output
    changes = {"participants.commands.bag": str(tmp_path / "motion"), "duration": "12 s"}
    trocar.run("identify", set=changes, record="recorded")
    done = CliRunner().invoke(app, ["recorded", "-o", "own.yaml", "--plot", "own.png"])
    assert done.exit_code == 0, done.output
    own = OwnDynamics.load(tmp_path / "own.yaml")
    assert max(own.fit["relative_residual"].values()) < 0.15
    moving = own.bodies["insertion"].mass - own.bodies["counterweight"].mass
    published = arm_bodies.psm(instrument("400006"))
    assert moving == pytest.approx(published["insertion"].mass - published["counterweight"].mass, rel=0.2)
    assert own.joints["yaw"].viscous == pytest.approx(0.136, rel=0.05)
    MountedPsm.model_validate(
        {"instrument": "400006", "dynamics": "own.yaml"}, context={"directory": tmp_path}
    )


def test_a_missing_output_directory_is_said_before_the_fit(tmp_path):
    file = tmp_path / "own.csv"
    file.write_text("time\n", "utf-8")
    done = CliRunner().invoke(app, [str(file), "-o", str(tmp_path / "no" / "arm.yaml")])
    assert "there is no directory" in str(done.exception)
