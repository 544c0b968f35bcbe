"""Contracts: names of all numbers, and differences from a policy's statement."""

import pytest
from pydantic import ValidationError

from devices.policies.params import PolicyParams
from robots.policies.contract import Contract

SCENE = {
    "arms": {"PSM1": {"instrument": "400006"}, "PSM2": {"instrument": "400006"}, "ECM": {}},
    "backend": "python:m:f",
}


def terms(**contract):
    return PolicyParams.model_validate({**SCENE, "contract": {"arms": ["PSM1", "PSM2"], **contract}}).terms


def test_open_h_has_sixteen_numbers_by_the_names_of_its_conversion():
    made = terms()
    state, action = ([field.name for field in part] for part in (made.state_fields, made.action_fields))
    assert (len(state), len(action)) == (16, 16)
    assert state[:3] == [f"psm1_pose.position.{axis}" for axis in "xyz"]
    assert state[7:9] == ["psm1_jaw", "psm2_pose.position.x"]
    assert action[3:8] == [*(f"psm1_sp.orientation.{axis}" for axis in "xyzw"), "psm1_jaw_sp"]
    assert str(made.state_fields[0]) == "psm1_pose.position.x [m] in ECM"


@pytest.mark.parametrize(
    ("action", "width"), [("open-h-dvrk", 16), ("joint", 14), ("cartesian-delta", 14), ("rel-xyz-rot6d", 20)]
)
def test_widths_of_two_arms(action, width):
    assert terms(action=action).width == width


def test_own_terms_fit():
    made = terms(cameras={"endoscope/left": {}})
    assert made.misfits(made.describe()) == []


@pytest.mark.parametrize(
    ("stated", "named"),
    [
        ({"horizon": 5}, "horizon: the policy has 5, the contract 1"),
        ({"action": 20}, "action: the policy has 20 numbers, the contract 16"),
        ({"state": ["x"]}, "state: the policy has 1 numbers"),
        ({"action_layout": "joint"}, "action_layout: the policy has 'joint'"),
        ({"cameras": {"wrist": [1, 2, 3]}}, "the policy needs 'wrist', the contract has none"),
        (
            {"cameras": {"endoscope/left": [480, 640, 3]}},
            "'endoscope/left' as [480, 640, 3], the contract as",
        ),
        ({"fps": 5}, "'fps' is no entry of a contract"),
    ],
)
def test_what_does_not_fit_is_named(stated, named):
    (misfit,) = terms(cameras={"endoscope/left": {}}).misfits(stated)
    assert named in misfit


def test_an_order_of_names_that_differs_is_named_by_its_place():
    made = terms()
    names = [field.name for field in made.state_fields]
    names[3:7] = [names[6], *names[3:6]]  # quaternion w x y z
    assert made.misfits({"state": names})[0].startswith("state[3]: the policy has 'psm1_pose.orientation.w'")


def test_an_arm_is_named_once():
    with pytest.raises(ValidationError, match="names an arm twice"):
        Contract(arms=("PSM1", "PSM1"))


@pytest.mark.parametrize("backend", ["pickle://x", "python:", "python:module", "phyton:m:f"])
def test_a_backend_of_no_known_form_is_refused(backend):
    with pytest.raises(ValidationError, match=r"python:FILE\.py:NAME"):
        PolicyParams.model_validate({**SCENE, "backend": backend})
