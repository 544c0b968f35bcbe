import pytest
from pydantic import ValidationError

from engines.mujoco.params import SceneParams

MIDDLE = {"position": [0, 0, 0]}


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        ({"table": {**MIDDLE, "size": ["0 m", "1 m", "1 m"]}}, "greater than 0"),
        (
            {"objects": {"a": {"kind": "block", **MIDDLE, "size": ["1 mm", "-1 mm", "1 mm"]}}},
            "greater than 0",
        ),
        (
            {"objects": {"a": {"kind": "ring", **MIDDLE, "wire_radius": "8 mm"}}},
            r"wire_radius \(0.008 m\) must be less than radius \(0.008 m\)",
        ),
        ({"objects": {"a": {"kind": "needle", **MIDDLE, "radius": "0.4 mm"}}}, "must be less than radius"),
        ({"objects": {"PSM1": {"kind": "ring", **MIDDLE}}}, "not the name of an arm"),
        ({"objects": {"a": {"kind": "cube", **MIDDLE}}}, "'ring', 'needle', 'block'"),
    ],
)
def test_what_cannot_lie_in_a_scene_is_refused(scene, message):
    with pytest.raises(ValidationError, match=message):
        SceneParams.model_validate({"arms": {"PSM1": {}}, **scene})
