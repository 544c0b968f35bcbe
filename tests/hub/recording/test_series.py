import sys
from pathlib import Path

import numpy as np
import pytest

from hub.planning.plan import Plan
from hub.planning.scenario_file import load
from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from hub.session.launch import plan_of
from schemas.codec import encode
from schemas.errors import MissingExtraError, RecordingError
from schemas.message import Message
from schemas.ros import Float64Message, Float64MultiArray, JointState, StringMessage
from schemas.trocar_msgs import GrantMessage
from tests.hub.sample_session import write_session

JOINTS = "robot.PSM1/measured_js"


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    directory = tmp_path_factory.mktemp("session") / "run"
    assert write_session(directory).complete
    return Recording(str(directory))


def recorded(directory: Path, *messages: tuple[str, int, Message], plan: Plan | None = None) -> Recording:
    attachments = {} if plan is None else {"plan.json": plan.model_dump_json().encode()}
    with Recorder(directory, attachments=attachments) as recorder:
        for topic, time_ns, message in messages:
            recorder.write(recorder.add_channel(topic, message.ros_type), time_ns, encode(message))
    return Recording(directory)


def test_ports_are_listed_and_read_by_name(session: Recording) -> None:
    assert session.ports == {
        "robot.PSM1/probe/pose": "geometry_msgs/msg/PoseStamped",
        "robot.PSM1/probe/twist": "geometry_msgs/msg/TwistStamped",
        "stylus.pose": "geometry_msgs/msg/PoseStamped",
        "tissue.probe/wrench": "geometry_msgs/msg/WrenchStamped",
    }
    assert session.participants == ("robot", "stylus", "tissue")
    assert "stylus.pose" in session
    assert "stylus.twist" not in session
    assert [*session] == [*session.ports] == session._ipython_key_completions_()
    wrench = session["tissue.probe/wrench"]
    assert wrench.values.shape == (500, 6)
    assert len(wrench) == 500
    assert np.allclose(wrench.time, np.arange(1, 501) * 1e-3)
    assert 1.0 < wrench["force"][:, 2].max() < 3.0
    assert (wrench["force.z"] == wrench.values[:, 2]).all()
    assert wrench.fields == ("force", "torque")
    assert wrench.columns == ("force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z")
    assert (wrench.frame, wrench.unit, wrench.names) == ("PSM1_base", "", ())
    assert session["stylus.pose"].columns[3:] == tuple(f"orientation.{axis}" for axis in "xyzw")
    by_topic = session["/engine/tissue/out/probe/wrench"]
    assert (by_topic.values == wrench.values).all()


def test_a_wrong_name_gets_the_nearest_one(session: Recording) -> None:
    with pytest.raises(RecordingError, match=r"no port 'stylus\.poes'\. Did you mean 'stylus\.pose'"):
        session["stylus.poes"]
    with pytest.raises(RecordingError, match=r"no port '/hub/grand'\. Did you mean '/hub/grant'"):
        session["/hub/grand"]
    with pytest.raises(RecordingError, match=r"no field 'force\.w'\. Did you mean 'force\."):
        session["tissue.probe/wrench"]["force.w"]


def test_messages_without_vector_form(session: Recording) -> None:
    grants = session["/hub/grant"]
    with pytest.raises(RecordingError, match=r"'/hub/grant' is of type .*Grant, which has no vector form"):
        _ = grants.values
    time, first = next(grants.messages())
    assert isinstance(first, GrantMessage)
    assert (time, first.step) == (0.0, 0)
    assert len(list(grants.messages())) == len(grants.time) == 500
    assert repr(grants) == "<Series /hub/grant: trocar_msgs/msg/Grant; 500 messages>"


def test_joints_are_in_the_order_of_their_names(tmp_path: Path) -> None:
    one, two = np.array([1.0, 2.0]), np.array([3.0, 4.0])
    joints = recorded(
        tmp_path / "run",
        ("/engine/robot/out/PSM1/measured_js", 0, JointState(name=["a", "b"], position=one, effort=two)),
        (
            "/engine/robot/out/PSM1/measured_js",
            1_000_000,
            JointState(name=["b", "a"], position=one[::-1] + 0.5, effort=two[::-1] + 0.5),
        ),
    )[JOINTS]
    assert joints.values.tolist() == [[1, 2, 3, 4], [1.5, 2.5, 3.5, 4.5]]
    assert joints.names == ("a", "b")
    assert joints.fields == ("position", "effort")
    assert joints.columns == ("position.a", "position.b", "effort.a", "effort.b")
    assert joints["effort"].tolist() == [[3, 4], [3.5, 4.5]]
    assert joints["position.b"].tolist() == [2, 2.5]
    assert "fields position, effort" in repr(joints)


def test_numbers_and_arrays(tmp_path: Path) -> None:
    recording = recorded(
        tmp_path / "run",
        ("/array", 0, Float64MultiArray(data=np.arange(3.0))),
        ("/number", 0, Float64Message(data=7.0)),
        ("/text", 0, StringMessage(data="x")),
    )
    assert recording["/array"].columns == ("data.0", "data.1", "data.2")
    assert recording["/array"]["data.2"].tolist() == [2]
    assert recording["/number"].columns == ("data",)
    assert recording["/number"]["data"].tolist() == [[7]]
    assert [m for _, m in recording["/text"].messages()] == [StringMessage(data="x")]
    assert recording.ports == {}
    assert repr(recording).startswith("<Recording run_0: 0 s; participants none; 0 ports; 3 messages; ")


def test_a_series_without_messages_is_empty(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run", attachments={}) as recorder:
        recorder.add_channel("/number", Float64Message.ros_type)
        recorder.write(recorder.add_channel("/other", Float64Message.ros_type), 0, encode(Float64Message()))
    series = Recording(tmp_path / "run")["/number"]
    assert (series.time.shape, series.values.shape) == ((0,), (0, 0))
    assert (series.fields, series.columns, series.names, series.frame) == ((), (), (), "")
    assert series.to_frame().empty


def test_units_and_shapes_are_those_that_were_declared(tmp_path: Path) -> None:
    loaded = load("pick")
    plan, _ = plan_of(loaded.scenario, loaded.params)
    jacobian = Float64MultiArray(data=np.arange(36.0))
    recording = recorded(
        tmp_path / "run",
        ("/engine/robot/out/needle/lift", 0, Float64Message(data=0.01)),
        ("/engine/motion/out/PSM1/body/jacobian", 0, jacobian),
        plan=plan,
    )
    assert recording["robot.needle/lift"].unit == "m"
    assert "in m" in repr(recording["robot.needle/lift"])
    assert recording["motion.PSM1/body/jacobian"]["data"].tolist() == jacobian.data.reshape(1, 6, 6).tolist()


def test_a_data_frame_has_a_column_for_each_component(session: Recording) -> None:
    wrench = session["tissue.probe/wrench"]
    frame = wrench.to_frame()
    assert frame.index.name == "time"
    assert tuple(frame.columns) == wrench.columns
    assert (frame["force.z"].to_numpy() == wrench["force.z"]).all()
    assert frame.loc[0.1:0.2, "force.z"].mean() > 0


def test_without_pandas_a_data_frame_says_what_to_install(
    session: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(
        MissingExtraError, match=r"needs the package 'pandas'.*pip install 'trocar\[notebook\]'"
    ):
        session["stylus.pose"].to_frame()


def test_a_notebook_shows_a_table(session: Recording) -> None:
    assert repr(session).startswith(
        "<Recording palpation: 0.5 s; participants robot, stylus, tissue; 4 ports; 3,630 messages; "
    )
    page = session._repr_html_()
    assert "<b>palpation</b>, 0.5 s" in page
    assert "<td>stylus.pose</td><td>geometry_msgs/msg/PoseStamped</td><td>125</td>" in page


def test_payloads_are_not_trusted(tmp_path: Path) -> None:
    good = encode(Float64Message(data=1.0))
    with Recorder(tmp_path / "run", attachments={}) as recorder:
        channel = recorder.add_channel("/number", Float64Message.ros_type)
        recorder.write(channel, 0, good)
        recorder.write(channel, 1, good[:4] + np.array([np.nan]).tobytes())
    with pytest.raises(RecordingError, match=r"topic '/number' at 1 ns: .*finite"):
        _ = Recording(tmp_path / "run")["/number"].values
