"""Actions of a learning environment: how far tips and jaws go, and what stops them."""

from math import radians

import numpy as np
import pytest

import trocar
from controllers.actions import Actions, ActionsParams
from hub.participant import Inputs, Setup
from schemas.errors import ScenarioError

ARMS = {"PSM1": {"instrument": "LARGE_NEEDLE_DRIVER_400006", "position": [0, 0, 0.2]}}
BOX = [[-0.03, -0.03, 0.01], [0.03, 0.03, 0.10]]
PERIOD = 20_000_000


def make(**params):
    return Actions("actions", ActionsParams.model_validate({"arms": ARMS, "workspace": BOX, **params}))


def acted(actions, *rows):
    """Return the outputs after a whole step for each row."""
    outputs = actions.configure(Setup(PERIOD, None))
    for i in range(10 * len(rows)):
        values = {"action": np.array(rows[i // 10], float)}
        outputs = actions.step(i * PERIOD, PERIOD, Inputs(values))
    return {name: value.copy() for name, value in outputs.items()}


def test_it_keeps_the_contract():
    trocar.check_engine(make, period_ns=PERIOD, inputs={"action": [1.0, 0.5, -1.0, 0.3, -1.0]})


def test_an_action_of_1_is_ten_millimetres_and_thirty_degrees():
    actions = make()
    start = acted(make(), [0, 0, 0, 0, 1])["PSM1/goal_cp"]
    moved = acted(actions, [1, -1, -1, 1, -1])
    assert moved["PSM1/goal_cp"][:3] - start[:3] == pytest.approx([0.01, -0.01, -0.01])
    angle = 2.0 * np.arccos(abs(moved["PSM1/goal_cp"][3:] @ start[3:]))
    assert angle == pytest.approx(radians(30.0))
    assert moved["PSM1/jaw/servo_jp"] == pytest.approx([0.0], abs=1e-12)
    tip = actions.params.arms.present_arms["PSM1"].chain.frames(moved["PSM1/servo_jp"])[-1]
    assert tip[:3, 3] + [0.0, 0.0, 0.2] == pytest.approx(moved["PSM1/goal_cp"][:3], abs=1e-9)


def test_more_than_1_is_1():
    assert np.array_equal(
        acted(make(), [9, 0, 0, 0, 9])["PSM1/servo_jp"], acted(make(), [1, 0, 0, 0, 1])["PSM1/servo_jp"]
    )


def test_a_goal_stays_in_the_workspace():
    found = acted(make(), *[[1, 0, -1, 0, 1]] * 9)
    assert found["PSM1/goal_cp"][[0, 2]] == pytest.approx([0.03, 0.01])
    assert found["PSM1/refused"] == [0.0]


def test_a_goal_out_of_reach_is_counted_and_not_taken():
    far = {"workspace": [[-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]], "displacement": 0.2}  # over the remote centre
    found = acted(make(**far), [0, 0, 1, 0, 1])
    assert found["PSM1/refused"] == [1.0]
    assert found["PSM1/goal_cp"] == pytest.approx(acted(make(**far), [0, 0, 0, 0, 1])["PSM1/goal_cp"])
    assert np.array_equal(found["PSM1/servo_jp"], [0.0, 0.0, 0.12, 0.0, 0.0, 0.0])


def test_a_period_that_does_not_divide_the_step_is_refused():
    with pytest.raises(ScenarioError, match="no multiple of the period"):
        make().configure(Setup(30_000_000, None))


def test_a_hand_that_is_not_there_is_refused():
    with pytest.raises(ValueError, match="PSM2 is no arm of the scene"):
        make(hands=["PSM2"])
    with pytest.raises(ScenarioError, match="no instrument with a jaw"):
        make(arms={"PSM1": {}})


def test_an_electrode_has_power_instead_of_a_jaw():
    hook = {"arms": {"PSM1": ARMS["PSM1"] | {"instrument": "400183"}}, "power": "25 W"}
    trocar.check_engine(lambda: make(**hook), period_ns=PERIOD, inputs={"action": [0, 0, 0, 0, -1.0]})
    for last, watts in ((-0.5, 25.0), (0.0, 0.0)):
        found = acted(make(**hook), [0, 0, 0, 0, last])
        assert found["PSM1/energy"] == watts
        assert "PSM1/jaw/servo_jp" not in found
