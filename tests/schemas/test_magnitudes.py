"""Physical parameters beyond any sense are refused, and so is a state that a session computes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from engines.bullet.params import BulletParams
from engines.mujoco.params import MujocoParams
from hub.participant import Outputs, Setup, Stepped
from hub.testing.sessions import run_in_process
from schemas.errors import ParticipantError
from schemas.magnitudes import MAGNITUDES
from schemas.ports import Port
from schemas.quantity import Acceleration, Length, Mass, Stiffness

BLOCK: dict[str, Any] = {"size": ["60 mm", "60 mm", "20 mm"], "young_modulus": "10 kPa", "nodes": 75}


@pytest.mark.parametrize(
    ("type_", "value"),
    [(Acceleration, 1e200), (Acceleration, 1e6), (Mass, 1e-9), (Length, "100 km"), (Stiffness, -1e12)],
)
def test_a_size_without_a_meaning_is_refused(type_: Any, value: Any) -> None:
    with pytest.raises(ValidationError, match=r"has no meaning here: expected 0.* to .*\("):
        TypeAdapter[float](type_).validate_python(value)


@pytest.mark.parametrize("unit", MAGNITUDES)
def test_the_limits_leave_room(unit: str) -> None:
    limits = MAGNITUDES[unit]
    assert 0 <= limits.least < 1 < limits.most
    assert limits.reason


def test_rounding_noise_of_a_computed_position_is_accepted() -> None:
    assert TypeAdapter[float](Length).validate_python(-7.03e-17) == -7.03e-17


@pytest.mark.parametrize(
    "changes",
    [
        {"gravity": 1e200},
        {"timestep": "1 ns"},
        {"organs": {"block": {**BLOCK, "size": ["900 m", "900 m", "900 m"]}}},
        {"organs": {"block": {**BLOCK, "damping": "100 s"}}},
        {"organs": {"block": {**BLOCK, "position": [1e200, 0, 0]}}},
    ],
    ids=["gravity", "sub-step", "size", "damping", "place"],
)
def test_tissue_out_of_any_sense_is_refused(changes: dict[str, Any]) -> None:
    """Each of them ended as `done` with another force, or started for more than a minute."""
    with pytest.raises(ValidationError):
        BulletParams.model_validate({"organs": {"block": BLOCK}, **changes})


def test_a_robot_with_sub_steps_of_a_nanosecond_is_refused() -> None:
    with pytest.raises(ValidationError, match="timestep"):
        MujocoParams.model_validate({"arms": {"PSM1": {"instrument": "400006"}}, "timestep": "1 ns"})


class Growing(Stepped):
    """A force that grows by a factor of a thousand in each step."""

    ports = (
        Port(name="force", causality="output", type="geometry_msgs/msg/WrenchStamped"),
        Port(name="count", causality="output", type="std_msgs/msg/Float64MultiArray"),
    )

    def configure(self, setup: Setup) -> Outputs:
        del setup
        self._size = 1.0
        return self._outputs()

    def step(self, t: int, h: int, inputs: Any) -> Outputs:
        del t, h, inputs
        self._size *= 1e3
        return self._outputs()

    def _outputs(self) -> Outputs:
        return {"force": np.full(6, self._size), "count": np.full(1, 1e12 * self._size)}

    def state_hash(self) -> int:
        return 0

    def close(self) -> None:
        """Nothing is open."""


def test_a_force_out_of_any_sense_ends_the_session() -> None:
    """The count, which is no physical quantity, may be of any size."""
    tree = {"name": "growth", "step": "1 ms", "duration": "10 ms"}
    with pytest.raises(
        ParticipantError, match=r"'tissue' failed at step 3: output 'force' has a size of 1e\+12"
    ):
        run_in_process(tree, {"tissue": Growing("tissue", None)})
