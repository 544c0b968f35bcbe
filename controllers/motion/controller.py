"""The motion controller as a participant: all arms of cart and console under CRTK's commands."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from controllers.motion.following import Followers
from controllers.motion.frames import base_in_world, reference_frame
from controllers.motion.params import MotionParams
from controllers.motion.ports import arm_ports, setup_joint_ports
from controllers.motion.setup_joints import SetupJoints
from controllers.motion.telemetry import Telemetry
from hub.participant import Controller, Inputs, Outputs, Params, Setup
from robots.dvrk.crtk import CART_FRAME
from robots.transform import inverse_transform
from schemas.errors import MissingExtraError
from schemas.ports import Port
from schemas.vectors import Vector

if TYPE_CHECKING:
    from controllers.motion.arm import Arm

__all__ = ["MotionController"]


class MotionController(Controller):
    """Executes CRTK's commands to each arm, and commands the drives.

    Connect `motion.drive/* -> robot.*` and `robot.* -> motion.sense/*`.
    """

    params_model: ClassVar[type[Params]] = MotionParams
    params: MotionParams

    def __init__(self, name: str, params: MotionParams) -> None:
        super().__init__(name, params)
        self._arms: dict[str, Arm] = {}
        self._telemetry: Telemetry | None = None
        self._followers: Followers | None = None
        self._period = 0.0
        self._camera_stand = base_in_world("ECM", params) if "ECM" in params.arms.present_arms else None
        self._world_seen, self._camera_seen = np.eye(4), b""
        self._outputs: dict[str, Any] = {}
        self._setup_joints = SetupJoints(params, self._outputs)

    @property
    def ports(self) -> tuple[Port, ...]:
        """CRTK's commands, states and events of each arm, and drives and sensors on the robot.

        `<arm>/...`, `drive/<arm>/...` and `sense/<arm>/...`; on the cart also `SUJ/<arm>/...`, the setup
        joints under the arm.
        """
        params, period = self.params, self.params.publish_period
        ports = [
            port
            for name, arm in params.arms.driven_arms.items()
            for port in arm_ports(name, arm, reference_frame(name, params), period)
        ]
        if params.mounting == "cart":
            ports += [
                port
                for name in params.arms.present_arms
                for port in setup_joint_ports(name, CART_FRAME, period)
            ]
        return tuple(ports)

    def configure(self, setup: Setup) -> Outputs:
        """Put every arm at the position of the parameters."""
        if find_spec("ruckig") is None:
            raise MissingExtraError(f"participant '{self.name}' (kind motion)", "motion", "ruckig")
        from controllers.motion.arm import Arm

        period = self._period = setup.period_ns * 1e-9
        self._arms = {
            name: Arm(name, self.params, self._camera, period, self._outputs)
            for name in self.params.arms.driven_arms
        }
        self._telemetry = Telemetry([(name, arm.chain, arm.weight) for name, arm in self._arms.items()])
        self._publish(self._telemetry)
        self._outputs |= self._telemetry.outputs
        self.keep(*(part for arm in self._arms.values() for part in arm.state), *self._setup_joints.state)
        return self._outputs

    def _camera(self) -> Vector | None:
        """Return the pose of the world in the frame of the ECM's tip, shape (4, 4), if there is an ECM.

        The same array until the ECM moves.
        """
        if self._camera_stand is None:
            return None
        position = self._arms["ECM"].position
        if (seen := position.tobytes()) != self._camera_seen:
            self._camera_seen = seen
            self._world_seen = inverse_transform(
                self._camera_stand @ self._arms["ECM"].chain.forward(position)
            )
        return self._world_seen

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Execute commands and advance all setpoints by `h` nanoseconds."""
        arms = self._arms.values()
        for arm in arms:
            arm.sense(inputs)
        following = [setpoint for arm in arms for setpoint in arm.step(t, h, inputs)]
        if following:
            if self._followers is None or self._followers.setpoints != following:
                self._followers = Followers(following, self._period)
            self._followers.step()
        for name, arm in self._arms.items():
            arm.drive()
            if arm.refitted:
                self._refit(name, arm)
        if self._telemetry is not None and not (t + h) % self.params.publish_period:
            self._publish(self._telemetry)
        self._setup_joints.step(t, h, inputs)
        return self._outputs

    def _refit(self, name: str, arm: Arm) -> None:
        """Take over the kinematics of another instrument of an arm."""
        arm.refitted, self._followers = False, None
        if self._telemetry is not None:
            self._telemetry.fit(name, arm.chain)

    def _publish(self, telemetry: Telemetry) -> None:
        """Update the states not published at every step."""
        for name, arm in self._arms.items():
            arm.publish(telemetry.rows[name])
        telemetry.update(wrenches=not telemetry.wrenches <= self.unread)

    def restore(self, state: bytes) -> None:
        """Return to a saved state, of trajectories from their start, goal and age."""
        super().restore(state)
        for name, arm in self._arms.items():
            arm.recompute_derived()
            if arm.refitted:
                self._refit(name, arm)
        self._setup_joints.recompute_derived()

    def close(self) -> None:
        """Release the arms."""
        self._arms.clear()
        self._telemetry = self._followers = None
        self._outputs.clear()
