"""The motion controller as a participant: all arms of a patient cart under CRTK's commands."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, ClassVar

from controllers.motion.frames import base_in_world, reference_frame
from controllers.motion.params import MotionParams
from controllers.motion.ports import arm_ports, setup_joint_ports
from controllers.motion.setup_joints import SetupJoints
from hub.participant import Inputs, Outputs, Params, Setup, Stepped, restore_arrays, state_hash
from robots.dvrk.crtk import CART_FRAME
from schemas.errors import MissingExtraError
from schemas.ports import Port
from schemas.vectors import Vector

if TYPE_CHECKING:
    from controllers.motion.arm import Arm

__all__ = ["MotionController"]


class MotionController(Stepped):
    """Takes CRTK's commands for each arm, and tells the drives where to be: `motion.drive/* -> robot.*`,
    `robot.* -> motion.sense/*`.
    """

    params_model: ClassVar[type[Params]] = MotionParams
    params: MotionParams

    def __init__(self, name: str, params: MotionParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._arms: dict[str, Arm] = {}
        self._setup_joints = SetupJoints(params)
        self._camera_stand = base_in_world("ECM", params) if "ECM" in params.arms.driven else None
        self._outputs: dict[str, Any] = {}

    @property
    def ports(self) -> tuple[Port, ...]:
        """Per arm: CRTK's commands in, its states and events out; `drive/<arm>/...` and `sense/<arm>/...`
        towards the robot.

        On the cart also `SUJ/<arm>/...`, the setup joints that carry it.
        """
        params, period = self.params, self.params.publish_period
        ports = [
            port
            for name, arm in params.arms.driven.items()
            for port in arm_ports(name, arm, reference_frame(name, params), period)
        ]
        if params.mounting == "cart":
            ports += [
                port for name in params.arms.driven for port in setup_joint_ports(name, CART_FRAME, period)
            ]
        return tuple(ports)

    def configure(self, setup: Setup) -> Outputs:
        """Put every arm where the parameters say."""
        if find_spec("ruckig") is None:
            raise MissingExtraError(f"participant '{self.name}' (kind motion)", "motion", "ruckig")
        from controllers.motion.arm import Arm

        period = setup.period_ns * 1e-9
        self._setup_joints = SetupJoints(self.params)
        self._arms = {name: Arm(name, self.params, self._camera, period) for name in self.params.arms.driven}
        for arm in self._arms.values():
            arm.publish()
            self._outputs |= arm.outputs
        self._outputs |= self._setup_joints.outputs
        return self._outputs

    def _camera(self) -> Vector | None:
        """Return the pose of the ECM's tip in the world, shape (4, 4), if there is an ECM."""
        return None if self._camera_stand is None else self._camera_stand @ self._arms["ECM"].tip

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Heed commands and advance all setpoints by `h` nanoseconds."""
        arms = self._arms.values()
        for arm in arms:
            arm.sense(inputs)
        due = not (t + h) % self.params.publish_period
        for arm in arms:
            arm.step(t, h, inputs)
            if due:
                arm.publish()
            self._outputs |= arm.events
        self._setup_joints.step(t, h, inputs)
        self._outputs |= self._setup_joints.outputs
        return self._outputs

    def _state(self) -> tuple[Vector, ...]:
        return (*(array for arm in self._arms.values() for array in arm.state), *self._setup_joints.state)

    def state_hash(self) -> int:
        """Return the hash of what is measured and commanded, and of every arm's operating state."""
        return state_hash(*self._state())

    def save(self) -> bytes:
        """Return the state of every arm; trajectories as their start, goal and age."""
        return b"".join(array.tobytes() for array in self._state())

    def restore(self, state: bytes) -> None:
        """Return to a saved state. Raises StateError if it has the wrong size."""
        restore_arrays(self.name, self._state(), state)
        for arm in self._arms.values():
            arm.restored()

    def close(self) -> None:
        """Let go of the arms."""
        self._arms.clear()
        self._outputs.clear()
