from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer
from pydantic import ValidationError

from devices.simulated_touch.params import SimulatedTouchParams
from devices.simulated_touch.path import recorded_path
from schemas.codec import encode, ros2msg_definition
from schemas.errors import RecordingError
from schemas.message import Message
from schemas.ros import Joy, Point, Pose, PoseStamped

MS = 10**6
EPOCH = 1_700_000_000 * 10**9


def _write(file: Path, messages: list[tuple[str, int, Message]]) -> Path:
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for topic, ms, message in messages:
            if topic not in channels:
                schema = writer.register_schema(
                    message.ros_type, "ros2msg", ros2msg_definition(message.ros_type).encode()
                )
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channels[topic], EPOCH + ms * MS, encode(message), EPOCH + ms * MS)
        writer.finish()
    return file


def _pose(x: float) -> PoseStamped:
    return PoseStamped(pose=Pose(position=Point(x=x)))


def _joy(*buttons: int) -> Joy:
    return Joy(buttons=np.array(buttons, np.int32))


RIGHT = [("/device/console/out/right/pose", ms, _pose(ms / 1000)) for ms in (0, 10, 20)]
LEFT = [("/device/console/out/left/pose", ms, _pose(0.0)) for ms in (0, 10, 20)]
BUTTONS = [
    ("/device/console/out/right/buttons", ms, _joy(*held))
    for ms, held in ((5, (1, 0)), (6, (1, 1)), (12, (0,)))
]


def test_the_hand_goes_evenly_from_one_recorded_pose_to_the_next(tmp_path: Path) -> None:
    path = recorded_path(_write(tmp_path / "hand.mcap", [*RIGHT, *LEFT, *BUTTONS]), "right", 0)
    assert path.position(0.004) == (pytest.approx((0.004, 0.0, 0.0)), pytest.approx((1.0, 0.0, 0.0)))
    assert path.position(1.0) == ((0.02, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert [path.buttons(ms / 1000) for ms in (0, 5, 6, 11, 12)] == [
        (False, False),
        (True, False),
        (True, True),
        (True, True),
        (False, False),
    ]


def test_without_recorded_buttons_the_hand_holds_the_dead_man(tmp_path: Path) -> None:
    path = recorded_path(_write(tmp_path / "hand.mcap", [("/pose", 0, _pose(0.3))]), "right", 1)
    assert path.buttons(0.0) == (False, True)
    assert path.position(5.0)[0] == (0.3, 0.0, 0.0)
    assert path.orientation(5.0) == ((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0))


def test_a_recording_without_this_hand(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="'middle/pose'"):
        recorded_path(_write(tmp_path / "hand.mcap", [*RIGHT, *LEFT]), "middle", 0)


def test_a_recording_is_found_beside_the_scenario(tmp_path: Path) -> None:
    _write(tmp_path / "hand.mcap", RIGHT)
    params = {"styluses": {"right": {"path": "hand.mcap"}}}
    context = {"directory": tmp_path}
    found = SimulatedTouchParams.model_validate(params, context=context)
    assert found.styluses["right"].path == tmp_path / "hand.mcap"
    assert SimulatedTouchParams.model_validate_json(found.model_dump_json(), context=context) == found
    with pytest.raises(ValidationError, match="no recording at"):
        SimulatedTouchParams.model_validate(
            {"styluses": {"right": {"path": "foot.mcap"}}}, context={"directory": tmp_path}
        )
