"""Sessions that their caller steps: the same hashes as any other, again and again, and what is refused."""

import numpy as np
import pytest

import trocar
from schemas.errors import ScenarioError, SessionError
from trocar.messages import Header, Point, Pose, PoseStamped, Quaternion

SCENARIO = """
name: stepped
step: 10 ms
window: 5
duration: 100 ms
scene:
  looks: false
  arms: {PSM1: {instrument: LARGE_NEEDLE_DRIVER_400006, position: [0, 0, 200 mm]}}
  table: {position: [0, 0, 0], size: [200 mm, 200 mm, 10 mm], soft: true}
  objects: {needle: {kind: needle, position: [0, 0, 0.4 mm]}}
participants:
  actions: {kind: actions, period: 20 ms, workspace: [[-50 mm, -50 mm, 9 mm], [50 mm, 50 mm, 90 mm]]}
  robot: {kind: mujoco, timestep: 1 ms, publish_period: 10 ms}
order: [actions, robot]
connections: [actions.* -> robot.*]
"""
PORT = "actions.action"


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("stepped") / "stepped.yaml"
    path.write_text(SCENARIO)
    return path


@pytest.fixture(scope="module")
def session(file):
    with trocar.SteppedSession(trocar.load_scenario(file)) as made:
        yield made


def test_its_state_hash_is_that_of_a_session_of_the_hub(file, session):
    session.restart()
    session.advance(10)
    assert session.state_hash == trocar.run(file).state_hash


def test_it_begins_again_with_the_same_bits_whatever_came_before(session):
    hashes = []
    for noise in (0.0, 1.0):
        session.restart()
        session.advance(20, {PORT: np.full(5, noise)})
        session.restart()
        session.advance(20, {PORT: np.array([1.0, 0.0, -1.0, 0.5, -1.0])})
        hashes.append(session.state_hash)
    assert hashes[0] == hashes[1]


def test_what_is_given_enters_and_is_recorded_and_verifies(session, tmp_path):
    session.restart(tmp_path / "one")
    session.advance(20, {PORT: np.array([1.0, 0.0, 0.0, 0.0, 1.0])})
    session.advance(7, {"robot.needle/place": (pose(0.02, 0.01),)})
    assert session["robot.needle/pose"][:2] == pytest.approx([0.02, 0.01], abs=1e-4)
    assert session["actions.PSM1/goal_cp"][0] == pytest.approx(0.02)  # the action holds until another
    state_hash = session.state_hash
    session.restart()
    found = trocar.verify(tmp_path / "one")
    assert found.same
    assert (found.steps, found.hashes) == (27, 27 + 14)
    assert len(state_hash) == 32


def pose(x, y):
    return PoseStamped(
        header=Header(frame_id="world"),
        pose=Pose(position=Point(x=x, y=y, z=0.4e-3), orientation=Quaternion(x=0.0, y=0.0, z=0.0, w=2.0)),
    )


def test_its_values_may_be_kept(session):
    session.restart()
    session.advance(2)
    before = session["robot.PSM1/measured_js"]
    kept = before.copy()
    session.advance(20, {PORT: np.ones(5)})
    assert np.array_equal(before, kept)
    assert not np.array_equal(session["robot.PSM1/measured_js"], kept)


def test_numbers_have_names(session):
    session.restart()
    session.advance(2)
    joints = session.read("robot.PSM1/measured_js")
    assert joints.names[2] == "insertion"
    assert joints.fields == ("position", "velocity", "effort")
    assert joints["position"].tolist() == joints.values[:6].tolist()
    assert joints["velocity.insertion"] == joints.values[8]
    assert joints.columns[8] == "velocity.insertion"
    tip = session.read("robot.PSM1/measured_cp")
    assert (tip.frame, tip.fields, tip["orientation"].shape) == (
        "PSM1_base",
        ("position", "orientation"),
        (4,),
    )
    assert session.read("robot.needle/slip").unit == "m"
    assert "position.z 0.000399" in repr(session.read("robot.needle/pose"))


@pytest.mark.parametrize(
    ("work", "problem"),
    [
        (lambda s: s.advance(1, {"actions.acton": np.zeros(5)}), "Did you mean 'actions.action'"),
        (lambda s: s.advance(1, {"robot.PSM1/servo_jp": np.zeros(6)}), "no input without a connection"),
        (lambda s: s["robot.needle/posse"], "Did you mean 'robot.needle/pose'"),
        (lambda s: s.read("robot.PSM1/measured_cp")["place"], "no field 'place'.*position"),
        (lambda s: s.look("robot"), "no participant that only looks; there is none"),
    ],
)
def test_what_is_not_there_is_named(session, work, problem):
    session.restart()
    with pytest.raises(SessionError, match=problem):
        work(session)


def test_devices_are_refused():
    with pytest.raises(ScenarioError, match="a stepped session has no devices, and the scenario has stylus"):
        trocar.SteppedSession(trocar.load_scenario("palpation"))
