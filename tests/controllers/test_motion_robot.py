"""The motion controller with the arms as MuJoCo moves them."""

from pathlib import Path

import numpy as np
import pytest

from controllers.motion.controller import MotionController
from controllers.motion.params import MotionParams
from hub.inputs import Inputs
from hub.participant import Setup
from robots import rotation
from robots.dvrk import arms
from schemas.ports import Port
from tests.controllers.motion_rig import HOME, H, cp, jp

pytest.importorskip("mujoco")

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams

CHAIN = arms.chain("PSM1")


def start_of(port: Port):
    return np.array(port.start) if port.start is not None else np.zeros(3 * len(port.names))


class Bench:
    """Controller and engine, stepped one after the other."""

    def __init__(self):
        self.robot = MujocoEngine("robot", MujocoParams.model_validate({"arms": {"PSM1": {"instrument": "400006"}}, "looks": False}))
        self.motion = MotionController("motion", MotionParams.model_validate({"arms": {"PSM1": {"instrument": "400006"}}, "initial_state": "homed"}))
        self.values = {p: {q.name: start_of(q) for q in p.ports if q.causality == "input" and q.variability == "signal"} for p in (self.robot, self.motion)}
        self.sensed = dict(self.robot.configure(Setup(H, Path())))
        self.told = dict(self.motion.configure(Setup(H, Path())))
        self.t, self.complaints = 0, []

    def step(self, **orders):
        for name in self.values[self.motion]:
            self.values[self.motion][name] = np.array(self.sensed[name.removeprefix("sense/")])
        inputs = Inputs(self.values[self.motion])
        inputs._events = {f"PSM1/{name}": (order,) for name, order in orders.items()}
        self.told = self.motion.step(self.t, H, inputs)
        self.complaints += [*self.told["PSM1/error"], *self.told["PSM1/warning"]]
        for name in self.values[self.robot]:
            self.values[self.robot][name] = np.array(self.told[f"drive/{name}"])
        self.sensed = self.robot.step(self.t, H, Inputs(self.values[self.robot]))
        self.t += H
        return self.sensed["PSM1/measured_js"][:6]


def test_move_jp_ends_within_a_tenth_of_a_millimetre_and_of_a_degree():
    bench, goal = Bench(), HOME + np.array([0.4, -0.3, 0.05, 0.6, 0.4, -0.5])
    bench.step(move_jp=jp(*goal))
    for _ in range(2500):
        measured = bench.step()
    one, other = CHAIN.forward(measured), CHAIN.forward(goal)
    turn = rotation.log(rotation.product(rotation.from_matrix(one), rotation.conjugate(rotation.from_matrix(other))))
    assert not bench.complaints
    assert np.linalg.norm(one[:3, 3] - other[:3, 3]) < 1e-4
    assert np.degrees(np.linalg.norm(turn)) < 0.1


def test_servo_cp_tracks_a_circle_of_40_mm_at_a_quarter_of_a_hertz_within_a_millimetre():
    bench, errors = Bench(), []
    start = CHAIN.forward(HOME)
    orientation = rotation.from_matrix(start)
    for k in range(5000):
        angle = 2 * np.pi * 0.25 * k * H * 1e-9
        goal = start[:3, 3] + 0.02 * np.array([np.sin(angle), 1 - np.cos(angle), 0.0])
        measured = bench.step(servo_cp=cp([*goal, *orientation], "PSM1_base"))
        errors.append(np.linalg.norm(CHAIN.forward(measured)[:3, 3] - goal))
    assert not bench.complaints
    assert np.sqrt(np.mean(np.square(errors[1000:]))) < 1e-3
