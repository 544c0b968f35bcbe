"""A program beside `trocar run psm`, which is another process: `trocar.connect`."""

import json
import os
import runpy
import socket
import subprocess
import sys
import tempfile
import threading
from itertools import count
from pathlib import Path

import numpy as np
import pytest

import trocar
from devices.programs.sessions import _find_hub
from hub.transport.hub_files import hub_file, running_hubs
from tests.hub.authorities import Authority, free_port
from tests.waiting import LIMIT_S, until
from trocar.programs import ConnectError, IsaacTeleopPsm, MotionError, Pose, SessionError, connect

pytest.importorskip("ruckig")
pytest.importorskip("mujoco")

ROOT = Path(__file__).parents[3]
HOME, AWAY = [0.0, 0.0, 0.12, 0.0, 0.0, 0.0], [0.3, -0.1, 0.11, 0.2, 0.1, -0.2]
_NUMBERS = count(1)


class Running:
    """`trocar run psm` under a name of its own."""

    def __init__(self, *words):
        self.name = f"psm_{os.getpid()}_{next(_NUMBERS)}"
        command = [sys.executable, "-P", "-m", "trocar", "run", "psm", "--set", f"name={self.name}"]
        self.process = subprocess.Popen(
            [*command, *words], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )

    def connect(self):
        until(lambda: any(hub.session == self.name for hub in running_hubs()))
        return connect(self.name, timeout_s=LIMIT_S)

    def end(self):
        self.process.terminate()
        return self.process.communicate(timeout=LIMIT_S)[0]


@pytest.fixture(scope="module")
def running():
    session = Running()
    yield session
    session.end()


@pytest.fixture
def program(running):
    with running.connect() as client:
        client.PSM1.move_jp(HOME).wait(LIMIT_S)
        yield client


def at_rest(arm):
    until(lambda: np.abs(arm.measured_js().velocity).max() < 1e-3)


def test_names_are_those_of_the_session(program):
    assert program.arms == ("ECM", "PSM1")
    assert list(program.cameras) == ["endoscope"]
    assert {"move_jp", "measured_cp", "local/measured_cp", "jaw/servo_jp"} <= set(program.PSM1.operations)
    assert {"PSM1", "ECM", "endoscope"} <= set(dir(program))
    with pytest.raises(AttributeError, match=r"has no 'PSM4'. Did you mean 'PSM1'"):
        _ = program.PSM4
    with pytest.raises(ConnectError, match="has no /ECM/jaw/measured_js"):
        _ = program.ECM.jaw


def test_an_arm_moves_and_its_pose_is_that_of_the_kinematics(program):
    arm = program.PSM1
    handle = arm.move_jp(AWAY)
    assert handle.is_busy()
    handle.wait(LIMIT_S)
    assert not handle.is_busy()
    assert not arm.operating_state().is_busy
    at_rest(arm)
    joints = arm.measured_js()
    assert joints.names == ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")
    assert joints.position == pytest.approx(AWAY, abs=5e-3)
    until(lambda: arm.setpoint_js().position == pytest.approx(AWAY, abs=1e-6))
    expected = trocar.chain("PSM1", "400006").forward(arm.measured_js().position)
    pose = arm.local.measured_cp()
    assert pose.matrix == pytest.approx(expected, abs=1e-3)
    assert (pose.frame, arm.measured_cp().frame) == ("PSM1_base", "ECM")
    assert np.abs(arm.measured_cv().linear).max() < 0.01
    assert arm.body.measured_cf().force.shape == (3,)


@pytest.mark.long
def test_an_arm_follows_isaac_teleop(program):
    lead = IsaacTeleopPsm(program.PSM1)
    home = program.PSM1.setpoint_cp()
    assert lead.home == pytest.approx(home.matrix, abs=1e-9)
    squeezed = np.concatenate([home.position, home.orientation]).astype(np.float32)
    for moved, jaws, opening in (
        (0.0, (-0.5, 0.5), 1.0),
        (0.005, (-0.295, 0.295), 0.5),
        (0.01, (-0.09, 0.09), 0.0),
    ):
        goal = squeezed + np.array([moved, 0, 0, 0, 0, 0, 0], np.float32)

        def followed(goal=goal, jaws=jaws, opening=opening):
            lead.follow(goal, np.array(jaws, np.float32))
            tip, jaw = program.PSM1.setpoint_cp(), program.PSM1.jaw.setpoint_js().position
            return np.allclose(tip.position, goal[:3], atol=1e-5) and np.allclose(jaw, [opening], atol=1e-5)

        until(followed)
    for pose, jaws in (
        (squeezed[:6], (0.0, 0.0)),
        (squeezed * np.nan, (0.0, 0.0)),
        (np.zeros(7), (0.0, 0.0)),
        (squeezed, (0.0,)),
    ):
        with pytest.raises(MotionError, match=r"PSM1: (ee_pose|jaw_targets|the quaternion)"):
            lead.follow(pose, jaws)
    with pytest.raises(MotionError, match="does not open"):
        IsaacTeleopPsm(program.PSM1, jaw_open=(0.0, 0.0))


def test_the_tip_and_the_jaw_move(program):
    arm = program.PSM1
    start = arm.setpoint_cp()
    goal = Pose(start.position + np.array([0.01, 0.0, 0.0]), start.orientation, start.frame)
    arm.move_cp(goal).wait(LIMIT_S)
    until(lambda: arm.setpoint_cp().position == pytest.approx(goal.position, abs=1e-6))  # comes by itself
    arm.move_cp(start.matrix).wait(LIMIT_S)
    until(lambda: arm.setpoint_cp().position == pytest.approx(start.position, abs=1e-6))
    arm.jaw.move_jp([0.2]).wait(LIMIT_S)
    until(lambda: arm.jaw.setpoint_js().position == pytest.approx([0.2], abs=1e-6))


def test_a_stream_is_followed(program):
    arm = program.PSM1
    goals = np.linspace(HOME, AWAY, 50)
    for goal in goals:
        arm.servo_jp(goal)
    until(lambda: np.allclose(arm.setpoint_js().position, AWAY, atol=1e-4))
    until(lambda: not arm.servo_jr(np.zeros(6)) and np.allclose(arm.setpoint_js().position, AWAY, atol=1e-3))


def test_a_refusal_is_an_exception_with_the_sentence_of_the_arm(program):
    arm = program.PSM1
    with pytest.raises(MotionError, match=r"PSM1: move_jp refused: joint yaw at 9 rad, allowed are -1.588"):
        arm.move_jp([9, *HOME[1:]]).wait(LIMIT_S)
    for _ in range(2):  # again, and at once
        with pytest.raises(MotionError, match="3 values in position, expected 6"):
            arm.move_jp([0, 0, 0.1]).wait(LIMIT_S)
    with pytest.raises(MotionError, match="needs a row of finite numbers"):
        arm.move_jp([np.nan] * 6)
    with pytest.raises(MotionError, match=r"state_command 'hom' is unknown. Did you mean 'home'"):
        arm.state_command("hom").wait(LIMIT_S)

    def refused():
        try:
            arm.servo_jp([9, *HOME[1:]])
        except MotionError as error:
            return str(error)
        return ""

    assert "servo_jp refused: joint yaw at 9 rad" in until(refused)


def test_the_operating_state_changes(program):
    arm = program.PSM1
    arm.disable().wait(LIMIT_S)
    assert arm.operating_state().state == "DISABLED"
    with pytest.raises(MotionError, match="the arm is DISABLED, allowed in ENABLED and homed"):
        arm.move_jp(AWAY).wait(LIMIT_S)
    arm.home().wait(LIMIT_S)
    assert arm.operating_state().is_homed


@pytest.mark.long
def test_pictures_come_with_their_time(program):
    first = program.endoscope.left(LIMIT_S)
    assert first.pixels.shape == (288, 320, 3)
    assert first.pixels.std() > 5.0, "the picture shows nothing"
    assert until(lambda: program.endoscope.left(LIMIT_S).stamp > first.stamp)


def test_of_two_programs_one_leads_an_arm_and_both_may_stop_it(program, running):
    program.PSM1.set_trajectory_ratio(0.05)
    with running.connect() as other:
        under_way = program.PSM1.move_jp(AWAY)
        until(lambda: program.PSM1.operating_state().is_busy)
        for _ in range(2):
            with pytest.raises(MotionError, match="may not move the arm while /python_"):
                other.PSM1.move_jp(HOME).wait(LIMIT_S)
        assert under_way.is_busy()
        with pytest.raises(MotionError, match=r"not finished after 0.01 s; it goes on"):
            under_way.wait(0.01)
        other.PSM1.hold()
        with pytest.raises(MotionError, match="abandoned before its goal"):
            under_way.wait(LIMIT_S)
    program.PSM1.set_trajectory_ratio(1.0)


@pytest.mark.long
def test_the_end_of_the_session_ends_the_wait_and_what_was_led_is_simulated_again(tmp_path):
    session = Running("--record", str(tmp_path / "led"))
    with session.connect() as program:
        arm = program.PSM1
        arm.move_jp(AWAY).wait(LIMIT_S)
        arm.set_trajectory_ratio(0.01)
        under_way = arm.move_jp(HOME)
        until(lambda: arm.operating_state().is_busy)
        threading.Timer(0.5, session.process.terminate).start()
        with pytest.raises(SessionError, match=f"session '{session.name}' has ended"):
            under_way.wait()
        with pytest.raises(SessionError, match="has ended"):
            arm.hold()
    session.end()
    assert trocar.verify(tmp_path / "led").same


@pytest.mark.long
def test_a_program_on_another_machine_needs_the_certificate_of_a_console(tmp_path):
    authority, endpoint = Authority.founded(tmp_path / "certs"), f"tls/127.0.0.1:{free_port()}"
    session = Running("--listen", endpoint, "--certs", str(authority.directory))
    try:
        session.connect().close()  # it has started
        with pytest.raises(ConnectError, match="is the certificate of 'stylus'"):
            trocar.connect(endpoint=endpoint, certificates=authority.issued("stylus").file)
        console = authority.issued("console").file
        with trocar.connect(endpoint=endpoint, certificates=console) as program:
            program.PSM1.move_jp(AWAY).wait(LIMIT_S)
            assert program.PSM1.measured_js().position == pytest.approx(AWAY, abs=0.01)
            with pytest.raises(MotionError, match="joint yaw at 9 rad"):
                program.PSM1.move_jp([9, *HOME[1:]]).wait(LIMIT_S)
            assert program.endoscope.right(LIMIT_S).pixels.shape == (288, 320, 3)
    finally:
        session.end()


@pytest.fixture
def alone(monkeypatch, tmp_path):
    """No session of this user runs."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


@pytest.mark.long
def test_without_a_session_it_is_said_how_to_start_one(alone):
    with pytest.raises(ConnectError, match=r"no session of this user runs .* trocar run psm"):
        trocar.connect(timeout_s=0.0)
    with pytest.raises(ConnectError, match=r"no session 'teleop' .* trocar run teleop"):
        trocar.connect("teleop", timeout_s=0.0)


@pytest.fixture
def endpoints():
    """Two endpoints where a process listens."""
    with socket.create_server(("127.0.0.1", 0)) as one, socket.create_server(("127.0.0.1", 0)) as two:
        yield [f"tcp/127.0.0.1:{hub.getsockname()[1]}" for hub in (one, two)]


@pytest.mark.long
def test_of_a_session_closed_to_programs_it_is_said_what_opens_it(alone, endpoints):
    with (
        hub_file(endpoints[0], [], session="peg-board"),
        pytest.raises(ConnectError, match=r"'peg-board' is not open to programs. .* --programs"),
    ):
        trocar.connect("peg-board")


@pytest.mark.long
def test_without_a_name_a_session_about_to_start_is_waited_for(alone, endpoints):
    with (
        hub_file(endpoints[0], [], session="teleop"),
        pytest.raises(ConnectError, match=r"'teleop' is not open to programs"),
    ):
        trocar.connect(timeout_s=0.3)
    with (
        hub_file(endpoints[0], [], session="teleop"),
        hub_file(endpoints[1], [], session="psm", programs=endpoints[1]),
    ):
        assert _find_hub("", 0.3).session == "psm"


def test_of_several_sessions_one_has_to_be_named(alone, endpoints):
    one, two = endpoints
    with (
        hub_file(one, [], session="psm", programs=one),
        hub_file(two, [], session="teleop", programs=two),
        pytest.raises(ConnectError, match=r"several sessions are open .*' at tcp/.*, '.*' at tcp/"),
    ):
        trocar.connect()


def test_a_program_loads_no_engine():
    code = "import json, sys, trocar; trocar.connect; print(json.dumps(sorted(sys.modules)))"
    loaded = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    engines = {"mujoco", "pybullet", "ruckig", "fmpy", "PIL", "matplotlib"}
    assert not engines & set(json.loads(loaded.stdout))


@pytest.mark.long
def test_the_script_and_the_notebook_of_the_documentation_run(running, monkeypatch, capsys):
    monkeypatch.setattr(trocar, "connect", lambda endpoint="": running.connect())
    runpy.run_path(str(ROOT / "examples" / "lead_psm1.py"))["main"]()
    written = capsys.readouterr().out
    assert written.count("mm from the corner") == 4
    assert "move_jp refused: joint yaw at 2 rad" in written
    assert "picture of 320 x 288 pixels" in written
    notebook = json.loads((ROOT / "examples" / "lead_psm1.ipynb").read_text())
    assert len(json.dumps(notebook)) < 5000
    names = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert not cell["outputs"]
            exec("".join(cell["source"]), names)
    assert "PSM1: move_jp refused" in capsys.readouterr().out
    assert names["picture"].pixels.shape == (288, 320, 3)
