"""A scripted procedure: CRTK commands to the motion controller, one after the other or together, each waited
for.

The routine is a client like any other: it gives a command, waits until the arm's operating state has said
busy and then not busy, and goes on. A command that is refused (the arm's `error` or `warning` port speaks)
ends the session with the controller's own words.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal, cast

import numpy as np
from pydantic import Field

from hub.participant import Inputs, Outputs, Params, Setup, Stepped, state_hash
from robots.dvrk.musha import HAND
from robots.dvrk.parameters import UnitQuaternion
from robots.dvrk.setup_joints import CartArm
from schemas.crtk import OperatingState, StringStamped
from schemas.errors import SessionError, StateError
from schemas.message import Message
from schemas.ports import Port
from schemas.quantity import Angle, Duration, Length
from schemas.ros import Header, JointState, Point, Pose, PoseStamped, Quaternion, StringMessage

__all__ = ["Routine", "RoutineParams"]


class _Order(Params):
    arm: CartArm


class MoveTip(_Order):
    """Bring the tip to a pose."""

    do: Literal["move_cp"]
    position: tuple[Length, Length, Length]
    orientation: UnitQuaternion = Field(description="quaternion x, y, z, w")
    frame: str | None = Field(
        default=None, description="frame_id of the pose; default: the arm's own base, `<arm>_base`"
    )

    def message(self) -> tuple[str, Message]:
        """Return port and message."""
        (x, y, z), (i, j, k, w) = self.position, self.orientation
        pose = Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=i, y=j, z=k, w=w))
        return f"{self.arm}/move_cp", PoseStamped(
            header=Header(frame_id=self.frame or f"{self.arm}_base"), pose=pose
        )


class MoveJoints(_Order):
    """Bring the joints to positions (rad, m)."""

    do: Literal["move_jp"]
    positions: tuple[float, ...] = Field(description="of all joints of the arm, in rad and m")

    def message(self) -> tuple[str, Message]:
        """Return port and message."""
        return f"{self.arm}/move_jp", JointState(position=np.array(self.positions))


class MoveJaw(_Order):
    """Open or close the jaw; where it has a roller, roll what it holds."""

    do: Literal["jaw"]
    angle: Angle
    roll: Angle | None = Field(
        default=None, description="for a jaw with a roller: by how much to have rolled the needle"
    )

    def message(self) -> tuple[str, Message]:
        """Return port and message."""
        return f"{self.arm}/jaw/move_jp", JointState(
            position=np.array([self.angle] if self.roll is None else [self.angle, self.roll])
        )


class MoveHand(_Order):
    """Bring the fingers of a hand into a mode."""

    do: Literal["hand"]
    mode: Literal["folded", "retractor", "grasp", "caliper"]
    closing: float = Field(default=0.0, ge=0.0, le=1.0, description="from 0, open, to 1, closed")

    def message(self) -> tuple[str, Message]:
        """Return port and message."""
        return f"{self.arm}/hand/move_jp", JointState(position=HAND.command(self.mode, self.closing))


class ChangeState(_Order):
    """Change the operating state."""

    do: Literal["state"]
    command: Literal["enable", "disable", "home", "unhome", "pause", "resume"]

    def message(self) -> tuple[str, Message]:
        """Return port and message."""
        return f"{self.arm}/state_command", StringStamped(string=self.command)


class Wait(Params):
    """Let time pass."""

    do: Literal["wait"]
    time: Duration = Field(ge=0)


Order = Annotated[MoveTip | MoveJoints | MoveJaw | MoveHand | ChangeState, Field(discriminator="do")]


class Together(Params):
    """Give several orders at once, and wait for all."""

    do: Literal["together"]
    orders: tuple[Order, ...] = Field(min_length=1)


Step = Annotated[
    MoveTip | MoveJoints | MoveJaw | MoveHand | ChangeState | Wait | Together, Field(discriminator="do")
]


class RoutineParams(Params):
    """The steps, and how long any of them may take."""

    steps: tuple[Step, ...] = Field(min_length=1)
    limit: Duration = Field(
        default=10 * 10**9,
        gt=0,
        description="simulated time after which an order that is not done ends the session",
    )


class Routine(Stepped):
    """Works through its steps; `step` says which one is under way, `done` becomes 1 when all are."""

    params_model: ClassVar[type[Params]] = RoutineParams
    params: RoutineParams

    def __init__(self, name: str, params: RoutineParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._arms = sorted({order.arm for step in params.steps for order in _orders(step)})
        self._commands = sorted({order.message()[0] for step in params.steps for order in _orders(step)})
        self._position, self._done = np.zeros(1), np.zeros(1)
        self._begun = np.full(1, -1.0)  # ns; -1: the step has not begun
        # 0: nothing is awaited, 1: busy is awaited, 2: not busy is awaited
        self._busy = np.zeros(len(self._arms))
        self._outputs: dict[str, Any] = {
            "step": self._position,
            "done": self._done,
            **dict.fromkeys(self._commands, ()),
        }

    @property
    def ports(self) -> tuple[Port, ...]:
        """Per arm its events in and the commands that the steps need out; progress."""
        types = {
            order.message()[0]: order.message()[1].ros_type
            for step in self.params.steps
            for order in _orders(step)
        }
        events = (
            ("operating_state", OperatingState.ros_type),
            ("error", StringMessage.ros_type),
            ("warning", StringMessage.ros_type),
        )
        return (
            *(
                Port(name=f"{arm}/{name}", causality="input", type=type_, variability="event")
                for arm in self._arms
                for name, type_ in events
            ),
            *(
                Port(name=name, causality="output", type=types[name], variability="event")
                for name in self._commands
            ),
            Port(
                name="step",
                causality="output",
                type="std_msgs/msg/Float64",
                description="number of the step under way, from 0",
            ),
            Port(
                name="done",
                causality="output",
                type="std_msgs/msg/Float64",
                description="1 when all steps are done",
            ),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start at the first step."""
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Listen to the arms; give the next orders if the last ones are done. Raises SessionError if one is
        refused or takes too long.
        """
        for name in self._commands:
            self._outputs[name] = ()
        self._listen(inputs)
        if self._done[0]:
            return self._outputs
        step = self.params.steps[int(self._position[0])]
        if self._begun[0] < 0.0:
            self._begin(step, t)
        elif self._is_over(step, t):
            self._position[0] += 1.0
            self._begun[0] = -1.0
            self._done[0] = float(self._position[0] == len(self.params.steps))
        return self._outputs

    def _begin(self, step: Step, t: int) -> None:
        self._begun[0] = t
        for order in _orders(step):
            port, message = order.message()
            self._outputs[port] += (message,)
            self._busy[self._arms.index(order.arm)] = 1.0

    def _listen(self, inputs: Inputs) -> None:
        where = int(self._position[0])
        for i, arm in enumerate(self._arms):
            for kind in ("error", "warning"):
                for message in inputs.events(f"{arm}/{kind}"):
                    raise SessionError(
                        f"routine '{self.name}', step {where}: {cast('StringMessage', message).data}"
                    )
            for message in inputs.events(f"{arm}/operating_state"):
                busy = cast("OperatingState", message).is_busy
                if self._busy[i]:
                    self._busy[i] = 2.0 if busy else 0.0 if self._busy[i] == 2.0 else 1.0

    def _is_over(self, step: Step, t: int) -> bool:
        if isinstance(step, Wait):
            return t - self._begun[0] >= step.time
        if t - self._begun[0] > self.params.limit:
            late = ", ".join(arm for arm, busy in zip(self._arms, self._busy, strict=True) if busy)
            raise SessionError(
                f"routine '{self.name}', step {int(self._position[0])}: {late} not done within"
                f" {self.params.limit / 1e9:g} s"
            )
        return not self._busy.any()

    def _state(self) -> bytes:
        return np.concatenate([self._position, self._done, self._begun, self._busy]).tobytes()

    def state_hash(self) -> int:
        """Return the hash of how far it has come."""
        return state_hash(self._state())

    def save(self) -> bytes:
        """Return how far it has come."""
        return self._state()

    def restore(self, state: bytes) -> None:
        """Go on from where a state was saved. Raises StateError if it is none of this routine's."""
        if len(state) != len(self._state()):
            raise StateError(
                f"participant '{self.name}': a saved state of {len(state)} bytes, this routine's has"
                f" {len(self._state())}; was it saved elsewhere?"
            )
        self._position[:], self._done[:], self._begun[:], self._busy[:] = np.split(
            np.frombuffer(state), [1, 2, 3]
        )

    def close(self) -> None:
        """Nothing to give back."""


def _orders(step: Step) -> Iterator[MoveTip | MoveJoints | MoveJaw | MoveHand | ChangeState]:
    """Yield what `step` orders arms to do."""
    if isinstance(step, Together):
        yield from step.orders
    elif not isinstance(step, Wait):
        yield step
