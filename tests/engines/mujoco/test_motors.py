"""Whole efforts of the motors: what holds the weight, without a change of the simulation."""

from pathlib import Path

import numpy as np
import pytest

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.participant import Inputs, Setup
from robots.dvrk import drives, dynamics
from robots.dvrk.instruments import instrument

PERIOD_NS = 500_000
TURNED = (0.0, 0.3826834323650898, 0.0, 0.9238795325112867)
"""By 45 degrees about y: quaternion x, y, z, w."""
DOWN = dynamics.STANDARD_GRAVITY * np.array([0.5**0.5, 0.0, -(0.5**0.5)])
"""Gravity in that base, m/s^2."""
TOOL = instrument("400006")


def stepped(steps, move=0.0, **params):
    """Return measured states (steps, 18) and the last state hash while the yaw moves at `move` rad/s."""
    arms = {"PSM1": {"instrument": "400006", "orientation": TURNED}}
    shared = {"looks": False, "rigid_wrench": False, "arms": arms}
    engine = MujocoEngine("robot", MujocoParams.model_validate(shared | params))
    outputs = engine.configure(Setup(PERIOD_NS, Path(), {}))
    ports = [port for port in engine.ports if port.causality == "input" and port.start is not None]
    inputs = Inputs({port.name: np.array(port.start, float) for port in ports})
    found = []
    for i in range(steps):
        inputs["PSM1/servo_jp"][0] = move * (i + 1) * PERIOD_NS * 1e-9
        outputs = engine.step(i * PERIOD_NS, PERIOD_NS, inputs)
        found.append(outputs["PSM1/measured_js"].copy())
    return np.array(found), engine.state_hash()


def test_a_motor_holds_the_weight_that_the_servo_does_not_see():
    (servo, hash_of_servo), (motor, hash_of_motor) = (
        stepped(400, measured_effort=which) for which in ("servo", "motor")
    )
    assert hash_of_motor == hash_of_servo
    assert (motor[:, :12] == servo[:, :12]).all()
    held = dynamics.of_psm(TOOL).gravity(motor[-1, :6], DOWN)
    assert motor[-1, 12:] - servo[-1, 12:] == pytest.approx(held, abs=2e-4)
    assert np.abs(held).max() > 0.3


def test_the_effort_is_the_one_that_accelerates():
    """Of the yaw while it starts: inertia times acceleration, weight, spring and friction."""
    (motor, _), (servo, _) = (stepped(40, move=0.5, measured_effort=which) for which in ("motor", "servo"))
    yaw, arm = drives.psm(TOOL)["yaw"], dynamics.of_psm(TOOL)
    accelerations = np.diff(motor[:, 6:12], axis=0, prepend=0.0) / (PERIOD_NS * 1e-9)
    for i in range(10, 20):
        q, v = motor[i, :6], motor[i, 6]
        needed = arm.inertia_matrix(q)[0] @ accelerations[i] + arm.gravity(q, DOWN)[0]
        needed += yaw.elasticity * q[0] + yaw.offset + yaw.viscous_friction * v + yaw.coulomb_friction
        assert motor[i, 12] == pytest.approx(needed, abs=0.015)
        assert abs(servo[i, 12] - needed) > 0.03
