"""The helpers for ports make the ports that the model makes when every field is stated."""

import pytest
from pydantic import ValidationError

from hub.participant import event_in, event_out, signal_in, signal_out
from schemas.ports import Port
from schemas.ros import Float64MultiArray, JointState, Joy, PoseStamped


def test_a_helper_states_causality_and_variability() -> None:
    pose = PoseStamped.ros_type
    for helper, causality, variability in (
        (signal_in, "input", "signal"),
        (signal_out, "output", "signal"),
        (event_in, "input", "event"),
        (event_out, "output", "event"),
    ):
        made = helper("pose", PoseStamped, "of the hand", frame="world", clock="wall")
        stated = {"name": "pose", "type": pose, "causality": causality, "variability": variability}
        rest = {"description": "of the hand", "frame": "world", "clock": "wall"}
        assert made == Port.model_validate(stated | rest)


def test_a_signal_is_an_array_of_one_number_unless_its_type_is_given() -> None:
    assert signal_in("torque", unit="N*m", start=(0.0,)) == Port(
        name="torque", causality="input", type=Float64MultiArray.ros_type, unit="N*m", start=(0.0,)
    )


def test_a_type_is_a_message_class_or_its_ros_name() -> None:
    assert event_in("buttons", Joy) == event_in("buttons", "sensor_msgs/msg/Joy")


def test_fields_are_those_of_a_port() -> None:
    names = ("yaw", "pitch")
    made = signal_out("servo_jp", JointState, names=names, fields=("position", "velocity"), period_ns=2)
    assert (made.names, made.fields, made.period_ns) == (names, ("position", "velocity"), 2)
    with pytest.raises(ValidationError, match="greater than or equal to 1"):
        signal_out("nodes", size=0)
