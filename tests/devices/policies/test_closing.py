"""A session in wall time ends although its policy is silent: the question on its way is given up."""

import threading
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from devices.policies.device import PolicyDevice
from devices.policies.params import PolicyParams
from schemas.ros import Header
from schemas.trocar_msgs import PolicyObservation
from tests.devices.policies.servers import groot_server, openpi_server
from tests.devices.policies.test_i4h import process
from tests.waiting import LIMIT_S

HERE = Path(__file__).parent


@contextmanager
def silent_openpi(asked):
    with openpi_server(lambda *_: asked.set()) as (address, _):
        yield address, "open-h-dvrk"


@contextmanager
def silent_groot(asked):
    ending = threading.Event()

    def answer(endpoint, data):
        if endpoint == "get_action":
            asked.set()
            ending.wait(LIMIT_S)
        return {}

    with groot_server(answer) as (address, _):
        yield address, "open-h-dvrk"
        ending.set()


@contextmanager
def silent_i4h(asked):
    with process(lambda _: asked.set()) as (address, _, _):
        yield address, "joint"


@contextmanager
def silent_child(asked):
    asked.set()
    yield "python:policies.py:slow", "open-h-dvrk"


@pytest.mark.parametrize("silent", [silent_openpi, silent_groot, silent_i4h, silent_child])
def test_a_silent_policy_does_not_keep_a_session(silent):
    asked = threading.Event()
    with silent(asked) as (address, layout):
        given = {
            "arms": {"PSM1": {"instrument": "400006"}},
            "backend": address,
            "contract": {"state": layout, "action": layout},
            "time": "wall",
            "timeout": "1 h",  # the test would not end
        }
        device = PolicyDevice("policy", PolicyParams.model_validate(given))
        device.open(HERE)
        state = np.zeros(len(device.params.terms.state_fields))
        device.write(
            "observation", PolicyObservation(header=Header(), number=1, state=state, tips=np.zeros(7))
        )
        assert asked.wait(LIMIT_S)
        device.close()
