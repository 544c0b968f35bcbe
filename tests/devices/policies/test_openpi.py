"""A policy behind openpi's websocket: what is sent, and bad days of the server."""

import subprocess
import sys

import numpy as np
import pytest

from devices.policies.array_messages import pack_openpi, unpack
from devices.policies.params import PolicyParams
from devices.policies.policy import Observation, open_policy
from schemas.errors import DeviceError, MessageError, ScenarioError
from tests.devices.policies.servers import openpi_server, pack, rows

pytest.importorskip("websockets")
PICTURE = np.random.default_rng(0).integers(0, 255, (224, 224, 3), np.uint8)
STATE = np.arange(8, dtype=np.float32)


def terms(**contract):
    cameras = {"endoscope/left": {}, "endoscope/right": {}, "wrist": {"key": "observation/psm1"}}
    given = {"arms": {"PSM1": {"instrument": "400006"}}, "backend": "openpi://127.0.0.1:1"}
    contract = {"horizon": 4, "cameras": cameras, "instruction": "pick it up", **contract}
    return PolicyParams.model_validate({**given, "contract": contract}).terms


def question(number=1):
    images = dict.fromkeys(("endoscope/left", "endoscope/right", "wrist"), PICTURE)
    return Observation(number, images, STATE, "pick it up")


def good(observation, connection):
    return pack({"actions": rows(4, 8), "server_timing": {"infer_ms": 1.0}})


def opened(address, timeout_s=20.0, **contract):
    return open_policy(address, terms(**contract), timeout_s=timeout_s)


def test_an_observation_has_openpis_keys_and_the_answer_comes_back():
    with openpi_server(good, {"reset_pose": [1.0, 2.0]}) as (address, seen):
        policy = opened(address)
        policy.reset(0)
        assert np.array_equal(policy.act(question()), rows(4, 8))
        assert policy.metadata == {"reset_pose": [1.0, 2.0]}
        policy.close()
    (observation,) = seen
    assert set(observation) == {
        "observation/image",
        "observation/wrist_image",
        "observation/psm1",
        "observation/state",
        "prompt",
    }
    assert np.array_equal(observation["observation/wrist_image"], PICTURE)
    assert observation["observation/state"].dtype == np.float32
    assert observation["prompt"] == "pick it up"


def ask_many(policy):
    for number in range(2, 1000):
        policy.act(question(number))


BAD = {
    "text": ("Traceback: out of memory", MessageError, "reports an error: Traceback: out of memory"),
    "noise": (b"\xc1\xff", MessageError, "no valid message"),
    "no actions": (pack_openpi({"action": rows(1, 8)}), MessageError, "answers without 'actions'"),
    "a list": (pack_openpi({"actions": [[0.0] * 8]}), MessageError, "expected an array of numbers"),
    "NaN": (pack_openpi({"actions": np.full((1, 8), np.nan)}), MessageError, "not finite"),
    "width": (pack_openpi({"actions": rows(4, 7)}), MessageError, r"shape \(4, 7\): the contract has 1 to 4"),
    "horizon": (pack_openpi({"actions": rows(5, 8)}), MessageError, "1 to 4 rows of 8"),
    "objects": (
        pack_openpi({"actions": {b"__ndarray__": True, b"data": b"", b"dtype": "|O", b"shape": [0]}}),
        MessageError,
        "only numbers are allowed",
    ),
    "sizes": (
        pack_openpi({"actions": {b"__ndarray__": True, b"data": b"1234", b"dtype": "<f4", b"shape": [9999]}}),
        MessageError,
        "with 4 bytes",
    ),
    "1 GB": (bytes(2**26 + 1), DeviceError, "has gone: .*1009"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_answer_is_named(case):
    message, error, said = BAD[case]
    with openpi_server(lambda *_: message) as (address, _):
        policy = opened(address)
        with pytest.raises(error, match=said):
            policy.act(question())
        policy.close()


def test_a_server_that_is_away_is_named():
    with openpi_server(good) as (address, _):
        pass
    with pytest.raises(DeviceError, match="cannot be reached"):
        opened(address)


def test_a_server_that_is_slow_is_named_and_its_late_answer_is_not_taken():
    with openpi_server(lambda *_: None) as (address, _):
        policy = opened(address)
        policy._timeout_s = 0.1
        with pytest.raises(DeviceError, match=r"has not answered within 0\.1 s"):
            policy.act(question())
        with pytest.raises(DeviceError, match="is closed"):
            policy.act(question(2))


def test_a_server_that_dies_in_mid_episode_is_named():
    def die(observation, connection):
        connection.socket.shutdown(2)

    with openpi_server(die) as (address, _):
        policy = opened(address)
        with pytest.raises(DeviceError, match="has gone"):
            policy.act(question())


def test_an_answer_to_a_question_of_another_session_is_named():
    def twice(observation, connection):
        connection.send(good(observation, connection))
        return good(observation, connection)

    with openpi_server(twice) as (address, _):
        policy = opened(address)
        policy.act(question())
        # the surplus answer is there once the next message is: the order on a connection is kept
        with pytest.raises(DeviceError, match="before the question: another session's"):
            ask_many(policy)


def test_a_server_that_states_another_contract_is_named():
    with (
        openpi_server(good, {"contract": {"action_layout": "joint"}}) as (address, _),
        pytest.raises(ScenarioError, match="the policy has 'joint', the contract 'open-h-dvrk'"),
    ):
        opened(address)


def test_messages_are_those_of_openpis_own_client():
    msgpack_numpy = pytest.importorskip("openpi_client.msgpack_numpy")
    tree = {"a": PICTURE, "b": STATE, "c": "text", "d": np.float32(2.0)}
    theirs, ours = msgpack_numpy.packb(tree), pack_openpi(tree)
    for read in (unpack(theirs), msgpack_numpy.unpackb(ours), unpack(ours)):
        assert np.array_equal(read["a"], PICTURE)
        assert np.array_equal(read["b"], STATE)
        assert (read["c"], float(read["d"])) == ("text", 2.0)


def test_openpis_own_client_talks_with_the_server_of_these_tests():
    pytest.importorskip("openpi_client.websocket_client_policy")
    program = """
import sys, numpy as np
from openpi_client.websocket_client_policy import WebsocketClientPolicy
policy = WebsocketClientPolicy("127.0.0.1", int(sys.argv[1]))
print(policy.infer({"observation/state": np.zeros(8, np.float32)})["actions"].shape)
"""
    with openpi_server(good) as (address, _):
        words = [sys.executable, "-c", program, address.rpartition(":")[2]]
        done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout.strip() == "(4, 8)", done.stderr
