"""A headset as a device: what its runtime knows of the head, in the axes of REP 103, and a diagnosis when that is nothing.

The libraries differ in where a head comes from; ports, frames, rate, retries and messages are the same and stand here.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from pydantic import Field

from devices.diagnosis import Diagnosis, Level
from devices.samples import pose_sample, twist_sample
from devices.vendor_axes import Quaternion, Vector3, quaternion, vector
from hub.participant import Device, Params, Sample
from schemas.errors import DeviceError
from schemas.ports import Port
from schemas.quantity import Duration

__all__ = ["HeadState", "Headset", "HeadsetParams", "NoHead", "Runtime"]

_RETRY_NS = 1_000_000_000
"""A runtime that is not there is looked for once a second: starting one takes seconds."""


class HeadsetParams(Params):
    """What any headset is told."""

    rate: float = Field(default=250.0, gt=0.0, le=1000.0, description="samples per second at most; a head's own motion stays far below 100 Hz")
    max_age: Duration = Field(default=100_000_000, gt=0, description="a pose or twist that is older is marked stale")


@dataclass(frozen=True, slots=True)
class HeadState:
    """Pose and velocity of a head as its runtime has them: vendors' axes (x right, y up, z towards the user), m, m/s, rad/s, of the base frame."""

    time: float
    """When this was so, s of the runtime's clock: states of one time are one sample."""
    position: Vector3
    orientation: Quaternion
    linear: Vector3 | None
    """None where the runtime does not know it, which leaves the twist out."""
    angular: Vector3 | None


@dataclass(frozen=True, slots=True)
class NoHead:
    """Why the runtime, though it answers, knows no head: nobody wears it, it sleeps, it is not tracked."""

    level: Level
    message: str


class Runtime(Protocol):
    """A runtime that has been connected to."""

    @property
    def hardware(self) -> str:
        """Model and serial number."""
        ...

    def locate(self) -> HeadState | NoHead:
        """Return where the head is now. Raises DeviceError where the runtime or the headset is gone."""
        ...

    def close(self) -> None:
        """Let go of the runtime."""
        ...


class Headset(Device):
    """Publishes `pose` and `twist` of a head in `<participant>_base`, and `diagnostics`.

    The head's own frame has x ahead, y to the left and z up. The twist is the velocity of that frame's origin and its angular velocity, both
    along the axes of the base frame. Runtimes are connected to and asked in the thread that reads, as some demand.
    """

    def __init__(self, name: str, params: HeadsetParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._period_ns, self._max_age_ns = round(1e9 / params.rate), params.max_age
        self._diagnosis = Diagnosis(name)
        self._pose, self._twist = (
            Port(name=port, causality="output", type=type_, frame=f"{name}_base", max_age_ns=params.max_age, clock="wall", description=text)
            for port, type_, text in (
                ("pose", "geometry_msgs/msg/PoseStamped", "of the head: x ahead, y to the left, z up"),
                ("twist", "geometry_msgs/msg/TwistStamped", "of the head, along the axes of the base frame"),
            )
        )
        self._runtime: Runtime | None = None
        self._newest: float | None = None
        self._due_ns = self._retry_ns = self._newest_ns = 0

    @abstractmethod
    def connect(self) -> Runtime:
        """Connect to the runtime. Raises DeviceError where there is none."""

    @property
    def ports(self) -> tuple[Port, ...]:
        """`pose`, `twist` and `diagnostics`."""
        return self._pose, self._twist, self._diagnosis.port

    def open(self, directory: Path) -> None:  # noqa: ARG002
        """Begin anew; the runtime is connected to by the first `read`."""
        self._diagnosis = Diagnosis(self.name)
        self._due_ns = self._retry_ns = self._newest_ns = 0

    def read(self, t: int) -> list[Sample]:
        """Return pose and twist if they are known and due, and a diagnosis whenever that changes."""
        if t < self._due_ns or (self._runtime is None and t < self._retry_ns):
            return []
        self._due_ns = max(self._due_ns + self._period_ns, t)
        try:
            if self._runtime is None:
                self._runtime = self.connect()
            return self._located(t, self._runtime)
        except DeviceError as error:
            self.close()
            self._retry_ns = t + _RETRY_NS
            return self._diagnosis.tell(Level.ERROR, f"{error}; it is looked for again every second")

    def _located(self, t: int, runtime: Runtime) -> list[Sample]:
        state = runtime.locate()
        if isinstance(state, NoHead):
            return self._diagnosis.tell(state.level, state.message, runtime.hardware)
        if state.time == self._newest:
            still = t - self._newest_ns > self._max_age_ns
            return self._diagnosis.tell(Level.STALE, "the runtime gives no new poses; look at its own software", runtime.hardware) if still else []
        self._newest, self._newest_ns = state.time, t
        try:
            pose = pose_sample(self._pose, t, vector(*state.position), quaternion(*state.orientation))
            if state.linear is None or state.angular is None:
                return [*self._diagnosis.tell(Level.WARN, "the runtime gives no velocity; look at its own software", runtime.hardware), pose]
            twist = twist_sample(self._twist, t, vector(*state.linear), vector(*state.angular))
        except ValueError as error:  # what is not finite, too
            return self._diagnosis.tell(Level.ERROR, f"the runtime gives no pose: {error}; look at its own software", runtime.hardware)
        return [*self._diagnosis.tell(Level.OK, "the head is tracked", runtime.hardware), pose, twist]

    def close(self) -> None:
        """Let go of the runtime."""
        if self._runtime is not None:
            self._runtime.close()
        self._runtime = None
