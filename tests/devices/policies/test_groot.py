"""A policy behind GR00T's ZeroMQ server: what is sent, and bad days of the server."""

import numpy as np
import pytest

from devices.policies.array_messages import pack_groot, unpack
from devices.policies.params import PolicyParams
from devices.policies.policy import Observation, open_policy
from schemas.errors import DeviceError, MessageError, ScenarioError
from tests.devices.policies.servers import groot_server, rows

pytest.importorskip("zmq")
PICTURE = np.random.default_rng(0).integers(0, 255, (96, 128, 3), np.uint8)
GROUPS = {"psm1_pose": 9, "psm1_gripper": 1, "psm2_pose": 9, "psm2_gripper": 1}


def terms(**contract):
    given = {
        "arms": {"PSM1": {"instrument": "400006"}, "PSM2": {"instrument": "400006"}},
        "backend": "groot://127.0.0.1:1",
    }
    own = {
        "arms": ["PSM1", "PSM2"],
        "action": "rel-xyz-rot6d",
        "horizon": 50,
        "cameras": {"endoscope/left": {"width": 128, "height": 96}},
        "instruction": "pick it up",
    }
    return PolicyParams.model_validate({**given, "contract": {**own, **contract}}).terms


def question():
    return Observation(1, {"endoscope/left": PICTURE}, np.arange(16, dtype=np.float32), "pick it up")


def actions(horizon=50, **changed):
    return {
        key: np.full((1, horizon, width), width, np.float32) for key, width in {**GROUPS, **changed}.items()
    }


def good(endpoint, data):
    return [actions(), {}] if endpoint == "get_action" else {}


MODALITIES = {
    "video": {
        "__ModalityConfig_class__": True,
        "as_json": {"delta_indices": [0], "modality_keys": ["endoscope_left"]},
    },
    "state": {"delta_indices": [0], "modality_keys": ["psm1_pose", "psm1_gripper"]},
    "action": {"delta_indices": list(range(50)), "modality_keys": list(GROUPS)},
    "language": {"delta_indices": [0], "modality_keys": ["annotation.human.task_description"]},
}


def test_an_observation_has_groots_form_and_the_groups_come_back_side_by_side():
    with groot_server(good, MODALITIES) as (address, seen):
        policy = open_policy(address, terms(), timeout_s=20.0)
        policy.reset(7)
        answer = policy.act(question())
        policy.close()
    assert answer.shape == (50, 20)
    assert answer[0].tolist() == [9.0] * 9 + [1.0] + [9.0] * 9 + [1.0]
    assert [request["endpoint"] for request in seen] == ["get_modality_config", "reset", "get_action"]
    assert seen[1]["data"] == {"options": {"episode": 7}}
    observation = seen[2]["data"]["observation"]
    assert np.array_equal(observation["video"]["endoscope_left"][0, 0], PICTURE)
    assert {key: value.shape for key, value in observation["state"].items()} == {
        "psm1_pose": (1, 1, 7),
        "psm1_gripper": (1, 1, 1),
        "psm2_pose": (1, 1, 7),
        "psm2_gripper": (1, 1, 1),
    }
    assert observation["state"]["psm2_pose"][0, 0].tolist() == [8, 9, 10, 11, 12, 13, 14]
    assert observation["language"] == {"annotation.human.task_description": [["pick it up"]]}


@pytest.mark.parametrize(
    ("answered", "said"),
    [
        ({"error": "CUDA out of memory"}, "reports an error: CUDA out of memory"),
        (b"\xc1", "no valid message"),
        ([actions(psm1_pose=7), {}], "'psm1_pose' with 50 rows of 7, expected rows of 9"),
        ([{"psm1_pose": rows(1, 9)}, {}], "answers without 'psm1_gripper'"),
        ([actions(horizon=51), {}], "1 to 50 rows of 20"),
        ([], "expected actions by key"),
        ("done", "expected actions by key"),
    ],
)
def test_a_bad_answer_is_named(answered, said):
    with groot_server(lambda *_: answered) as (address, _):
        policy = open_policy(address, terms(), timeout_s=20.0)
        with pytest.raises(MessageError, match=said):
            policy.act(question())
        policy.close()


@pytest.mark.parametrize(
    ("modality", "changed", "said"),
    [
        (
            "video",
            {"modality_keys": ["wrist_left"]},
            "video: the policy has wrist_left, the contract endoscope_left",
        ),
        (
            "action",
            {"modality_keys": ["psm1_pose"]},
            "the contract has psm1_gripper, psm2_pose, psm2_gripper",
        ),
        ("action", {"delta_indices": [0] * 60}, "horizon: the policy has 60 rows, the contract 50"),
        ("state", {"delta_indices": [0, 1]}, "the policy wants 2 instants"),
    ],
)
def test_modalities_that_do_not_fit_are_named(modality, changed, said):
    stated = {**MODALITIES, modality: {**MODALITIES["action"], **MODALITIES[modality], **changed}}
    if modality == "state":
        stated["state"]["modality_keys"] = ["psm1_pose"]
    stated[modality].pop("as_json", None)
    with groot_server(good, stated) as (address, _), pytest.raises(ScenarioError, match=said):
        open_policy(address, terms(), timeout_s=20.0)


def test_a_server_that_is_away_is_named():
    with groot_server(good) as (address, _):
        pass
    with pytest.raises(DeviceError, match="has not answered 'get_modality_config'"):
        open_policy(address, terms(), timeout_s=0.2)


def test_arrays_come_back_and_files_that_lie_are_refused():
    array = np.arange(6, dtype=np.float32).reshape(2, 3)
    assert np.array_equal(unpack(pack_groot({"a": array}))["a"], array)
    assert np.array_equal(unpack(pack_groot({"a": np.asfortranarray(array)}))["a"], array)
    packed = pack_groot({"a": array}).replace(b"(2, 3)", b"(2, 9)")
    with pytest.raises(MessageError, match="with 24 bytes"):
        unpack(packed)
    with pytest.raises(MessageError, match="only numbers"):
        pack_groot({"a": np.array([object()])})
