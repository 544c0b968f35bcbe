"""`trocar identify` reads what tools record, and says what a recording lacks."""

import numpy as np
import pytest

from learning.identification.measurements import measurements
from robots.dvrk.mounted import MountedPsm
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
    ],
)
def test_a_table_that_lacks_something_is_refused(tmp_path, text, reason):
    file = tmp_path / "own.csv"
    file.write_text(text, "utf-8")
    with pytest.raises(RecordingError, match=reason):
        measurements(file, "PSM1", JOINTS)


def test_dynamics_of_another_kind_of_instrument_are_refused(tmp_path):
    (tmp_path / "psm.yaml").write_text("{instrument: X, bodies: {}, joints: {}, discs: []}", "utf-8")
    with pytest.raises(ValueError, match=r"was identified with X.*identify the arm with such"):
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
