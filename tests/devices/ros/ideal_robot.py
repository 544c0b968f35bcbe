"""A robot that is at once where its drives are told to be: `motion.drive/* -> robot.*`, `robot.* ->
motion.sense/*`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from controllers.motion.controller import MotionController
from controllers.motion.params import MotionParams
from hub.participant import Inputs, Outputs, Params, Setup, Stepped, state_hash
from schemas.ports import Port

__all__ = ["IdealRobot", "motion"]


def motion(**params: Any) -> MotionController:
    return MotionController("motion", MotionParams.model_validate(params))


class IdealRobot(Stepped):
    def __init__(self, controller: MotionController) -> None:
        """Take the controller whose arms it is."""
        super().__init__("robot", Params())
        sensed = [port for port in controller.ports if port.name.startswith("sense/")]
        self._measured = {port.name.removeprefix("sense/"): port for port in sensed}
        self._state = {name: np.zeros(3 * len(port.names)) for name, port in self._measured.items()}
        starts = controller.params.arms.present_arms
        for name, state in self._state.items():
            arm, _, part = name.partition("/")
            start = starts[arm].start if part == "measured_js" else starts[arm].gripper.start
            state[: len(start)] = start

    @property
    def ports(self) -> tuple[Port, ...]:
        told = [
            port.model_copy(update={"name": name, "causality": "output"})
            for name, port in self._measured.items()
        ]
        commands = {name.replace("measured_js", "servo_jp"): port for name, port in self._measured.items()}
        return (
            *told,
            *(
                Port(name=name, causality="input", type=port.type, names=port.names)
                for name, port in commands.items()
            ),
        )

    def configure(self, setup: Setup) -> Outputs:
        return self._state

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        for name, state in self._state.items():
            command = inputs[name.replace("measured_js", "servo_jp")]
            state[: command.size] = command
        return self._state

    def state_hash(self) -> int:
        return state_hash(*self._state.values())

    def close(self) -> None:
        pass
