"""The device alone: pictures that do not fit or are missing are faults, by name."""

from pathlib import Path

import numpy as np
import pytest

from devices.policies.device import PolicyDevice
from devices.policies.params import PolicyParams
from hub.testing import check_device
from schemas.errors import MessageError
from schemas.ros import Header, Image, JointState, Time
from schemas.trocar_msgs import PolicyObservation

HERE = Path(__file__).parent
STATE = np.array([0.0, 0.0, -0.12, 0.0, 0.0, 0.0, 1.0, 0.3])


def params(**contract):
    given = {"arms": {"PSM1": {"instrument": "400006"}}, "backend": "python:policies.py:Still"}
    return PolicyParams.model_validate({**given, "contract": {"horizon": 2, **contract}})


def picture(width=32, encoding="rgb8"):
    data = np.zeros(16 * width * 3, np.uint8)
    return Image(height=16, width=width, encoding=encoding, step=3 * width, data=data)


@pytest.fixture
def device():
    made = PolicyDevice("policy", params(cameras={"endoscope/left": {"width": 32, "height": 16}}))
    made.open(HERE)
    yield made
    made.close()


def answers(device, number):
    observation = PolicyObservation(
        header=Header(stamp=Time.from_ns(number * 10**7)), number=number, state=STATE, tips=STATE[:7]
    )
    device.write("observation", observation)
    return [sample.message for sample in device.read(number * 10**7) if sample.port == "actions"]


def test_it_conforms(tmp_path):
    (tmp_path / "policies.py").write_text((HERE / "policies.py").read_text())
    check_device(lambda: PolicyDevice("policy", params()), directory=tmp_path)


def test_the_first_question_waits_for_the_first_picture(device):
    assert answers(device, 1) == []
    device.write("endoscope/left/image_raw", picture())
    (answer,) = answers(device, 2)
    assert (answer.fault, answer.number, answer.width, answer.actions.size) == ("", 2, 8, 16)
    assert answer.header.stamp.ns == 2 * 10**7


def test_a_camera_that_sends_nothing_is_a_fault(device):
    assert [answers(device, number) for number in (1, 2, 3)] == [[], [], []]
    (answer,) = answers(device, 4)
    assert "no picture of endoscope/left so far" in answer.fault


@pytest.mark.parametrize(
    ("sent", "said"), [(picture(width=64), "sends 64 x 16 rgb8"), (picture(encoding="bgr8"), "32 x 16 bgr8")]
)
def test_a_picture_of_another_form_is_a_fault_until_one_fits(device, sent, said):
    device.write("endoscope/left/image_raw", sent)
    (answer,) = answers(device, 1)
    assert said in answer.fault
    assert "the contract has 32 x 16 rgb8" in answer.fault
    device.write("endoscope/left/image_raw", picture())
    (answer,) = answers(device, 2)
    assert answer.fault == ""


def test_another_message_is_refused(device):
    with pytest.raises(MessageError, match="port 'observation' takes no JointState"):
        device.write("observation", JointState())
