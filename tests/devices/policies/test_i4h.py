"""A policy process of Isaac for Healthcare, played by a Zenoh peer with the messages of its workflow."""

import json
from contextlib import contextmanager, suppress

import numpy as np
import pytest
import zenoh

from devices.policies.array_messages import pack_openpi, unpack
from devices.policies.params import PolicyParams
from devices.policies.policy import Observation, open_policy
from schemas.errors import DeviceError, MessageError, ScenarioError
from tests.hub.authorities import free_port
from tests.waiting import until

STATE = np.arange(7, dtype=np.float32)
PICTURE = np.full((16, 32, 3), 7, np.uint8)


def terms(**contract):
    own = {
        "state": "joint",
        "action": "joint",
        "rate": 30,
        "horizon": 2,
        "cameras": {"wrist": {"width": 32, "height": 16}},
    }
    given = {"arms": {"PSM1": {"instrument": "400006"}}, "backend": "i4h:reach_psm@multicast"}
    return PolicyParams.model_validate({**given, "contract": {**own, **contract}}).terms


@contextmanager
def process(answer):
    """Serve: `answer(state)` returns the payload of a command, or None. Yields address, states, pictures."""
    config = zenoh.Config()
    endpoint = f"127.0.0.1:{free_port()}"
    for key, value in {
        "mode": "router",
        "listen/endpoints": [f"tcp/{endpoint}"],
        "scouting/multicast/enabled": False,
        "transport/shared_memory/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    states, pictures = [], []
    with zenoh.open(config) as session:
        command = session.declare_publisher("i4h/agentic/reach_psm/robot/command")

        def receive(sample):
            states.append(unpack(sample.payload.to_bytes()))
            if (payload := answer(states[-1])) is not None:
                command.put(payload)

        session.declare_subscriber("i4h/agentic/reach_psm/robot/state", receive)
        session.declare_subscriber(
            "i4h/agentic/reach_psm/camera/wrist", lambda s: pictures.append(unpack(s.payload.to_bytes()))
        )
        yield f"i4h:reach_psm@{endpoint}", states, pictures


def command(state, **changed):
    numbers = [*state["joint_positions"], *state["joint_positions"]]
    own = {"ts": 1, "request_id": 1, "attempt_index": 0, "horizon": 2, "dt": 1 / 30, "inference_ts": 1}
    ids = {key: state[key] for key in ("run_id", "episode_index")}
    return pack_openpi({**own, **ids, "joint_positions": numbers, **changed})


def ask(address, timeout_s=20.0, **contract):
    policy = open_policy(address, terms(**contract), timeout_s=timeout_s)
    try:
        policy.reset(5)
        return policy.act(Observation(1, {"wrist": PICTURE}, STATE))
    finally:
        policy.close()


def test_state_and_pictures_go_out_and_the_command_comes_back():
    with process(command) as (address, states, pictures):
        assert ask(address).tolist() == [STATE.tolist()] * 2
        until(lambda: pictures)
    assert states[0]["joint_positions"] == STATE.tolist()
    assert states[0]["episode_index"] == 5
    assert set(states[0]) == {
        "ts",
        "run_id",
        "episode_index",
        "attempt_index",
        "joint_positions",
        "joint_velocities",
        "is_running",
    }
    assert (pictures[0]["width"], pictures[0]["height"], len(pictures[0]["data"])) == (32, 16, 32 * 16 * 3)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"joint_positions": [float("nan")] * 14}, "not finite"),
        ({"joint_positions": [0.0] * 12}, r"shape \(2, 6\)"),
        ({"joint_positions": [0.0] * 13}, "cannot reshape"),
        ({"joint_positions": "left"}, "no joint positions"),
        ({"dt": 0.02}, r"rows 0\.02 s apart, the contract 0\.0333333 s \(30 a second\)"),
        ({"horizon": 0}, r"shape \(14,\)"),
    ],
)
def test_a_bad_command_is_named(changed, said):
    with (
        process(lambda state: command(state, **changed)) as (address, _, _),
        pytest.raises(MessageError, match=said),
    ):
        ask(address)


@pytest.mark.parametrize("changed", [{"run_id": "other"}, {"episode_index": 4}])
def test_a_command_for_another_session_is_not_taken(changed):
    with (
        process(lambda state: command(state, **changed)) as (address, _, _),
        pytest.raises(DeviceError, match="another session's"),
    ):
        ask(address, timeout_s=0.5)


def test_a_process_that_is_silent_is_named():
    with (
        process(lambda state: None) as (address, _, _),
        pytest.raises(DeviceError, match=r"has not answered within 0\.3 s$"),
    ):
        ask(address, timeout_s=0.3)


def test_a_payload_that_is_no_map_is_named():
    with (
        process(lambda state: b"\x93") as (address, _, _),
        pytest.raises(MessageError, match="no valid message"),
    ):
        ask(address)


def test_a_contract_with_poses_is_refused():
    with pytest.raises(ScenarioError, match="the contract needs state and action 'joint'"):
        ask("i4h:reach_psm@127.0.0.1:1", action="open-h-dvrk")


@pytest.mark.parametrize(
    ("backend", "is_warned"),
    [
        ("i4h:reach_psm@192.0.2.1:7447", True),
        ("openpi://[2001:db8::1]:8000", True),
        ("groot://gpu.example:5555/", True),
        ("i4h:reach_psm@127.0.0.1:1", False),
        ("openpi://[::1]:1", False),
    ],
)
def test_a_policy_on_another_machine_is_reached_in_the_clear_with_a_warning(caplog, backend, is_warned):
    with suppress(DeviceError, ScenarioError):
        open_policy(backend, terms(), timeout_s=0.05).close()
    assert ("in the clear" in caplog.text) == is_warned
