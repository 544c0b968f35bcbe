"""Scores of a session, of its re-simulation, of its recording, and of real arms in ROS bags."""

import json
import lzma
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hub.recording.recording import Recording
from hub.recording.report import report
from hub.recording.scores import score_numbers
from robots.dvrk.mounted.mounted_psm import MountedPsm
from schemas.errors import RecordingError, ScenarioError
from schemas.ros import Header, JointState, Point, Pose, PoseStamped, Quaternion
from tasks.recorded.ros_bag import score_ros_bag
from tasks.recorded.session import score_session
from tests.hub.recording.ros_bags import write
from tests.tasks.trials import minimum_jerk
from trocar import run, verify

pytestmark = pytest.mark.xdist_group("scores")  # its session is expensive: run once, in one process


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """A recorded session that ends when the needle has been grasped, and its summary."""
    directory = tmp_path_factory.mktemp("scores") / "run"
    return directory, run("hand-over", set={"duration": "2.6 s"}, record=directory, one_host=True)


@pytest.mark.long
def test_the_summary_has_the_card(session):
    card = session[1].scores["task"]
    assert (card["task"], card["goals"], card["reached"]) == ("hand-over-task", 1, 0)
    assert card["metrics"]["grasps"]["value"] == 1
    assert card["metrics"]["PSM1/path_length"]["value"] > 0.05
    assert card["metrics"]["PSM1/clutch_count"]["value"] is None
    assert json.loads(json.dumps(session[1].as_dict()))["scores"]["task"] == card


def test_a_recording_has_the_same_scores_to_the_bit(session):
    directory, summary = session
    (scored,) = score_session(Recording(directory), []).values()
    assert score_numbers(scored.card) == summary.scores["task"]
    assert [(event.event, event.object, event.arm) for event in scored.events] == [
        ("grasped", "needle", "PSM1")
    ]


@pytest.mark.long
def test_a_re_simulation_has_the_same_state(session):
    # the sums behind every score are part of the task's state hash
    found = verify(session[0])
    assert found.same, (found.first_difference_step, found.first_difference_participant)


def test_other_rules_may_be_asked_for_later(session):
    recording = Recording(session[0])
    (scored,) = score_session(recording, ["fls"]).values()
    assert [rule.rules for rule in scored.card.rules] == ["fls"]
    with pytest.raises(ScenarioError, match="Did you mean 'fls'"):
        score_session(recording, ["flss"])


def test_a_recording_without_what_the_task_reads_says_what_it_lacks(session, monkeypatch):
    recorded = Recording.__contains__
    lacks = "robot.needle/pose"
    monkeypatch.setattr(Recording, "__contains__", lambda file, port: port != lacks and recorded(file, port))
    with pytest.raises(RecordingError, match=r"it lacks robot.needle/pose, which 'task' reads.*--record"):
        score_session(Recording(session[0]), [])


@pytest.mark.long
def test_the_report_shows_card_events_and_paths(session, tmp_path):
    report(Recording(session[0]), tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    for words in ("Score: task", "task: events", "PSM1: path of the tip", 'class="bar"', "mscore passed"):
        assert words in text


@pytest.mark.long
def test_the_command_prints_json_and_refuses_unknown_rules(session):
    def score(*options):
        command = [sys.executable, "-P", "-m", "trocar", "score", session[0], *options]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    done = score("--rules", "mscore", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["scores"]["task"]["metrics"] == session[1].scores["task"]["metrics"]
    assert found["events"]["task"][0]["event"] == "grasped"
    refused = score("--rules", "icra206")
    assert (refused.returncode, "Did you mean 'icra2026'?" in refused.stderr) == (2, True)


def pose(position):
    x, y, z = position
    at = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(w=1.0))
    return PoseStamped(header=Header(frame_id="PSM1_base"), pose=at)


def metrics_of(path):
    return {one.name: one for one in score_ros_bag(path, []).card.metrics}


def test_a_bag_of_a_real_arm_has_the_metrics_that_need_no_more_than_its_tip(tmp_path):
    tips = minimum_jerk(2.0, 0.1)
    bag = write(tmp_path / "bag", [(0.01 * i, "/PSM1/measured_cp", pose(p)) for i, p in enumerate(tips)])
    found = metrics_of(bag)
    assert found["PSM1/path_length"].value == pytest.approx(0.1, rel=1e-3)
    assert found["PSM1/spectral_arc_length"].value == pytest.approx(-1.39, abs=0.02)
    assert "state them in the scene" in found["drops"].reason
    assert "rigid_wrench" in found["PSM1/peak_force"].reason


def test_joints_do_as_well(tmp_path):
    start = np.array(MountedPsm(instrument="LARGE_NEEDLE_DRIVER_400006").start)
    said = []
    for i, (x, _, _) in enumerate(minimum_jerk(2.0, 0.05)):
        joints = start + np.eye(6)[2] * x
        said.append((0.01 * i, "/PSM2/measured_js", JointState(name=list("abcdef"), position=joints)))
    found = metrics_of(write(tmp_path / "bag", said))
    assert found["PSM2/path_length"].value == pytest.approx(0.05, rel=1e-3)


def test_a_bag_without_an_arm_says_what_to_record(tmp_path):
    bag = write(tmp_path / "bag", [(0.0, "/needle/pose", pose((0.0, 0.0, 0.0)))])
    with pytest.raises(RecordingError, match="ros2 bag record /PSM1/measured_cp"):
        score_ros_bag(bag, [])


@pytest.mark.parametrize(
    ("at", "turn", "problem"),
    [
        ((0.0, 0.0, 0.0), 0.0, "the quaternion has norm 0 instead of 1"),
        ((1e300, 0.0, 0.0), 1.0, "is no place"),
    ],
)
def test_a_bag_with_a_pose_without_a_meaning(tmp_path, at, turn, problem):
    odd = pose(at)
    odd = odd.model_copy(
        update={"pose": odd.pose.model_copy(update={"orientation": Quaternion(x=0.0, y=0.0, z=0.0, w=turn)})}
    )
    bag = write(
        tmp_path / "bag", [(0.0, "/PSM1/measured_cp", pose((0, 0, 0))), (0.01, "/PSM1/measured_cp", odd)]
    )
    with pytest.raises(RecordingError, match=problem):
        score_ros_bag(bag, [])


def test_a_session_of_an_earlier_version_without_a_task_is_measured(tmp_path):
    packed = Path(__file__).parents[1] / "hub" / "recording" / "recordings_0_1_0" / "pick.mcap.xz"
    (tmp_path / "pick.mcap").write_bytes(lzma.decompress(packed.read_bytes()))
    (scored,) = score_session(Recording(tmp_path / "pick.mcap"), []).values()
    found = {one.name: one for one in scored.card.metrics}
    assert scored.card.task == "practice-task"
    assert (found["grasps"].value, found["grasps"].reason) == (0, "")
    assert found["PSM1/path_length"].reason == "the trial is too short"  # 50 ms
