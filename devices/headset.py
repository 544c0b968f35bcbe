"""A headset as a device: pose and twist of the head in the axes of REP 103, and a diagnosis.

Libraries differ in how they give the head's pose; ports, frames, rate, retries and messages are the same
for all, and are here.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from pydantic import Field

from devices.diagnosis import Diagnosis, Level
from devices.samples import SampleTimer, pose_sample, twist_sample
from devices.vendor_axes import Quaternion, Vector3, quaternion, vector
from hub.participant import Device, Params, Sample, signal_out
from robots import rotation
from schemas.errors import DeviceError
from schemas.ports import Port
from schemas.quantity import Duration
from schemas.ros import PoseStamped, TwistStamped

__all__ = ["HeadState", "Headset", "HeadsetParams", "NoHead", "Runtime"]


class HeadsetParams(Params):
    """Parameters of every headset."""

    rate: float = Field(
        default=250.0,
        gt=0.0,
        le=1000.0,
        description="samples per second at most; a head's own motion stays far below 100 Hz",
    )
    max_age: Duration = Field(
        default=100_000_000, gt=0, description="a pose or twist that is older is marked stale"
    )


@dataclass(frozen=True, slots=True)
class HeadState:
    """Pose and velocity of a head as its runtime has them, in the base frame: m, m/s, rad/s.

    Vendors' axes: x right, y up, z towards the user.
    """

    time: float
    """Time of the state, s of the runtime's clock: states of one time are one sample."""
    position: Vector3
    orientation: Quaternion
    linear: Vector3 | None
    """None where the runtime does not know it: then it is the displacement since the state before, over the
    time between.
    """
    angular: Vector3 | None


@dataclass(frozen=True, slots=True)
class NoHead:
    """Why the runtime answers without a pose: the headset is not worn, asleep or not tracked."""

    level: Level
    message: str


class Runtime(Protocol):
    """A runtime connected."""

    @property
    def hardware(self) -> str:
        """Model and serial number."""
        ...

    def locate(self) -> HeadState | NoHead:
        """Return the head's present state. Raises DeviceError if the runtime or the headset is lost."""
        ...

    def close(self) -> None:
        """Disconnect from the runtime."""
        ...


class Headset(Device):
    """Publishes `pose` and `twist` of a head in `<participant>_base`, and `diagnostics`.

    The head's own frame has x ahead, y to the left and z up. The twist is the velocity of that frame's origin
    and its angular velocity, both along the axes of the base frame. A runtime is connected and called in
    the thread that reads, as some demand.
    """

    def __init__(self, name: str, params: HeadsetParams) -> None:
        super().__init__(name, params)
        self._rate, self._max_age_ns = params.rate, params.max_age
        self._diagnosis = Diagnosis(name)
        self._pose, self._twist = (
            signal_out(port, type_, text, frame=f"{name}_base", max_age_ns=params.max_age, clock="wall")
            for port, type_, text in (
                ("pose", PoseStamped.ros_type, "of the head: x ahead, y to the left, z up"),
                ("twist", TwistStamped.ros_type, "of the head, along the axes of the base frame"),
            )
        )
        self._runtime: Runtime | None = None
        self._newest: HeadState | None = None
        self._newest_ns = 0
        self._timer = SampleTimer(self._rate)

    @abstractmethod
    def connect(self) -> Runtime:
        """Connect to the runtime. Raises DeviceError if there is none."""

    @property
    def ports(self) -> tuple[Port, ...]:
        """`pose`, `twist` and `diagnostics`."""
        return self._pose, self._twist, self._diagnosis.port

    def open(self, directory: Path) -> None:  # noqa: ARG002
        """Start; the first `read` connects to the runtime."""
        self._diagnosis = Diagnosis(self.name)
        self._timer = SampleTimer(self._rate)

    def read(self, t: int) -> list[Sample]:
        """Return pose and twist if they are known and due, and the diagnosis whenever it changes."""
        if not self._timer.due(t):
            return []
        try:
            if self._runtime is None:
                self._runtime = self.connect()
            return self._locate_pose(t, self._runtime)
        except DeviceError as error:
            self.close()
            self._timer.failed(t)
            return self._diagnosis.report(Level.ERROR, f"{error}; the next try is in a second")

    def _locate_pose(self, t: int, runtime: Runtime) -> list[Sample]:
        state, before = runtime.locate(), self._newest
        if isinstance(state, NoHead):
            self._newest = None
            return self._diagnosis.report(state.level, state.message, runtime.hardware)
        if before is not None and state.time == before.time:
            still = t - self._newest_ns > self._max_age_ns
            return (
                self._diagnosis.report(
                    Level.STALE, "the runtime gives no new poses; look at its own software", runtime.hardware
                )
                if still
                else []
            )
        self._newest, self._newest_ns = state, t
        try:
            samples = [pose_sample(self._pose, t, vector(*state.position), quaternion(*state.orientation))]
            linear, angular = _velocities(before, state)
            if linear is not None and angular is not None:
                samples.append(twist_sample(self._twist, t, vector(*linear), vector(*angular)))
        except ValueError as error:  # also of numbers that are not finite
            self._newest = None
            return self._diagnosis.report(
                Level.ERROR, f"the runtime gives no pose: {error}; look at its own software", runtime.hardware
            )
        return [*self._diagnosis.report(Level.OK, "the head is tracked", runtime.hardware), *samples]

    def close(self) -> None:
        """Disconnect from the runtime."""
        if self._runtime is not None:
            self._runtime.close()
        self._runtime = None
        self._newest = None


def _velocities(before: HeadState | None, now: HeadState) -> tuple[Vector3 | None, Vector3 | None]:
    """Return velocity and angular velocity in the vendors' axes; None if they are unknown."""
    if before is None or (now.linear is not None and now.angular is not None):
        return now.linear, now.angular
    dt = now.time - before.time
    vx, vy, vz = ((np.array(now.position) - before.position) / dt).tolist()
    turn = rotation.product(np.array(now.orientation), rotation.conjugate(np.array(before.orientation)))
    wx, wy, wz = (rotation.log(turn) / dt).tolist()
    return now.linear or (vx, vy, vz), now.angular or (wx, wy, wz)
