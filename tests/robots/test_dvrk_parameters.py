import pytest
from pydantic import TypeAdapter, ValidationError

from controllers.motion.params import MotionParams
from engines.mujoco.params import SceneParams
from robots.dvrk.parameters import InstrumentName

NAME = TypeAdapter(InstrumentName)


def test_an_instrument_goes_by_name_or_number_with_or_without_quotes():
    assert {NAME.validate_python(name) for name in ("LARGE_NEEDLE_DRIVER_400006", "400006", 400006)} == {
        "LARGE_NEEDLE_DRIVER_400006"
    }


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (399999, "no instrument '399999'. Known: "),
        (400143, "snake wrist"),
        (True, "valid string"),
        (400006.0, "valid string"),
    ],
)
def test_what_is_no_instrument_is_refused(name, message):
    with pytest.raises(ValidationError, match=message):
        NAME.validate_python(name)


@pytest.mark.parametrize("kind", [SceneParams, MotionParams])
@pytest.mark.parametrize(
    ("arm", "positions", "message"),
    [
        ("PSM1", ["0.9 m", 0, 0, 0, 0, 0], "joint lift at 0.9 m, allowed are -0.3798 .. 0.8425"),
        ("PSM3", ["-0.3 m", 0, 0, 0, 0, 0], "joint lift at -0.3 m, allowed are -0.2858 .. 0.9365"),
        ("ECM", [0, 0, 0, 0, "10 deg", 0], "joint tilt at 0.174533 rad, allowed are 0 .. 0"),
        ("PSM2", [0, 0, 0, 0, 0, "nan"], "not a quantity in rad"),
        ("PSM2", [0, 0, 0], "Field required"),
    ],
)
def test_a_setup_joint_is_set_inside_its_range(kind, arm, positions, message):
    scene = {"arms": {"PSM1": {"instrument": 400006}}, "mounting": "cart"}
    assert kind.model_validate({**scene, "setup_joints": {"PSM1": ["0.8 m", "3 rad", 0, 0, 0, 0]}})
    with pytest.raises(ValidationError, match=message):
        kind.model_validate({**scene, "setup_joints": {arm: positions}})


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        ({"arms": {"PSM1": {}}, "setup_joints": {"PSM1": [0, 0, 0, 0, 0, 0]}}, "set 'mounting: cart'"),
        (
            {"arms": {"PSM1": {}, "ECM": {"position": [0, 0, 0]}}, "mounting": "cart"},
            "ECM: position and orientation are for 'mounting: free'",
        ),
    ],
)
def test_where_an_arm_stands_is_said_once(scene, message):
    with pytest.raises(ValidationError, match=message):
        SceneParams.model_validate(scene)
