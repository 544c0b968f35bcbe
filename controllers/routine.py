"""A scripted procedure: CRTK commands to the motion controller, in sequence or at the same time.

The routine is a client like any other: it sends a command, waits until the arm's operating state was busy
and is not busy any more, and continues. Speeds and power are set at once. A refused command, with
an event on the arm's `error` or `warning`, ends the session with the text of that event.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal, cast

import numpy as np
from pydantic import Field

from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    array,
    event_in,
    event_out,
    flag,
    integer,
    signal_out,
)
from robots.dvrk.end_effectors.musha import HAND
from robots.dvrk.instruments import instrument
from robots.dvrk.parameters import InstrumentName, UnitQuaternion
from robots.dvrk.setup_joints import CartArm
from robots.dvrk.tool_type import tool_type
from schemas.crtk import OperatingState, StringStamped
from schemas.errors import SessionError
from schemas.message import Message
from schemas.ports import Port
from schemas.quantity import Angle, Duration, Length, Power
from schemas.ros import (
    EmptyMessage,
    Float64Message,
    Header,
    JointState,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    StringMessage,
)

__all__ = ["Routine", "RoutineParams"]


class _Command(Params):
    arm: CartArm


class MoveTip(_Command):
    """Move the tip to a pose."""

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


class MoveJoints(_Command):
    """Move the joints to positions (rad, m)."""

    do: Literal["move_jp"]
    positions: tuple[float, ...] = Field(description="of all joints of the arm, in rad and m")

    def message(self) -> tuple[str, Message]:
        """Return port and message."""
        return f"{self.arm}/move_jp", JointState(position=np.array(self.positions))


class MoveJaw(_Command):
    """Open or close the jaw; one with a roller also rolls the needle that it holds."""

    do: Literal["jaw"]
    angle: Angle
    roll: Angle | None = Field(default=None, description="for a jaw with a roller: angle of the roller")

    def message(self) -> tuple[str, Message]:
        """Return port and message."""
        return f"{self.arm}/jaw/move_jp", JointState(
            position=np.array([self.angle] if self.roll is None else [self.angle, self.roll])
        )


class MoveHand(_Command):
    """Move the fingers of a hand into a mode."""

    do: Literal["hand"]
    mode: Literal["folded", "retractor", "grasp", "caliper"]
    closing: float = Field(default=0.0, ge=0.0, le=1.0, description="from 0, open, to 1, closed")

    def message(self) -> tuple[str, Message]:
        """Return port and message."""
        return f"{self.arm}/hand/move_jp", JointState(position=HAND.command(self.mode, self.closing))


class ChangeState(_Command):
    """Change the operating state."""

    do: Literal["state"]
    command: Literal["enable", "disable", "home", "unhome", "pause", "resume"]

    def message(self) -> tuple[str, Message]:
        """Return port and message."""
        return f"{self.arm}/state_command", StringStamped(string=self.command)


class SetSpeed(_Command):
    """Let the moves of an arm have a share of its largest speeds from now on; done at once."""

    do: Literal["speed"]
    share: float = Field(gt=0, le=1)

    def message(self) -> tuple[str, Message]:
        """Return port and message."""
        return f"{self.arm}/trajectory_j/set_ratio_v", Float64Message(data=self.share)


class CloseClip(_Command):
    """Close a clip on the tube between the jaws of a clip applier; done at once."""

    do: Literal["clip"]

    def message(self) -> tuple[str, Message]:
        """Return port and message."""
        return f"{self.arm}/clip", EmptyMessage()


class ExchangeInstrument(_Command):
    """Give the arm one of its spare instruments, or the mounted one again."""

    do: Literal["exchange"]
    instrument: InstrumentName = Field(description="name or number, such as 400183")

    def message(self) -> tuple[str, Message]:
        """Return port and message."""
        return f"{self.arm}/set_tool_type", StringMessage(data=tool_type(instrument(self.instrument)))


class SetPower(_Command):
    """Let the generator of an energy instrument give a power from now on, 0 to stop; done at once."""

    do: Literal["energy"]
    power: Power = Field(ge=0, le=400)

    @property
    def output(self) -> Port:
        """Output with the power."""
        return signal_out(f"{self.arm}/energy", description="power of the generator", unit="W")

    @property
    def level(self) -> float:
        """Power, W."""
        return self.power


class SetFlow(_Command):
    """Let a suction irrigator suck or rinse from now on, 0 to stop; done at once."""

    do: Literal["suction", "irrigation"]
    share: float = Field(ge=0, le=1, description="of the most")

    @property
    def output(self) -> Port:
        """Output with the share."""
        return signal_out(f"{self.arm}/{self.do}", description="share of the most")

    @property
    def level(self) -> float:
        """Share of the most."""
        return self.share


class Wait(Params):
    """Wait."""

    do: Literal["wait"]
    time: Duration = Field(ge=0)


Command = Annotated[MoveTip | MoveJoints | MoveJaw | MoveHand | ChangeState, Field(discriminator="do")]


class Together(Params):
    """Send several commands at once, and wait for all."""

    do: Literal["together"]
    orders: tuple[Command, ...] = Field(min_length=1)


Step = Annotated[
    MoveTip
    | MoveJoints
    | MoveJaw
    | MoveHand
    | ChangeState
    | SetSpeed
    | CloseClip
    | ExchangeInstrument
    | SetPower
    | SetFlow
    | Wait
    | Together,
    Field(discriminator="do"),
]


class RoutineParams(Params):
    """The steps, and how long any of them may take."""

    open_to_pages: ClassVar[bool] = True

    steps: tuple[Step, ...] = Field(min_length=1)
    limit: Duration = Field(
        default=10 * 10**9,
        gt=0,
        description="simulated time after which a command that is not done ends the session",
    )


class RoutineState(Record):
    """Progress of the routine."""

    step = integer()
    """Number of the present step, from 0."""
    done = flag()
    """Whether all steps are."""
    begun_ns = integer(-1)
    """When the present step began, ns; -1: it has not begun."""
    busy = array("arms")
    """State of each arm: 0 nothing is awaited, 1 busy is awaited, 2 not busy is awaited."""


class Routine(Controller):
    """Executes its steps; `step` is the number of the present one, `done` becomes 1 after the last."""

    params_model: ClassVar[type[Params]] = RoutineParams
    params: RoutineParams

    def __init__(self, name: str, params: RoutineParams) -> None:
        super().__init__(name, params)
        self._arms = sorted({command.arm for step in params.steps for command in _commands(step)})
        self._commands = sorted(
            {command.message()[0] for step in params.steps for command in _commands(step)}
        )
        self._now = RoutineState(arms=len(self._arms))
        self._busy = self._now.busy
        set_levels = [step.output for step in params.steps if isinstance(step, SetPower | SetFlow)]
        self._set_levels = {port.name: port for port in set_levels}
        """Outputs of generators and suction irrigators."""
        self._levels = {name: np.zeros(1) for name in self._set_levels}
        """Power, W, or share of the most flow, by output."""
        self.keep(self._now, *self._levels.values())
        self._outputs: dict[str, Any] = {
            "step": self._now.part("step"),
            "done": self._now.part("done"),
            **dict.fromkeys(self._commands, ()),
            **self._levels,
        }

    @property
    def ports(self) -> tuple[Port, ...]:
        """The events of each arm in; the commands of the steps and the progress out."""
        types = {
            command.message()[0]: command.message()[1].ros_type
            for step in self.params.steps
            for command in _commands(step)
        }
        events = (
            ("operating_state", OperatingState.ros_type),
            ("error", StringMessage.ros_type),
            ("warning", StringMessage.ros_type),
        )
        return (
            *(event_in(f"{arm}/{name}", type_) for arm in self._arms for name, type_ in events),
            *(event_out(name, types[name]) for name in self._commands),
            *self._set_levels.values(),
            signal_out("step", Float64Message, "number of the present step, from 0"),
            signal_out("done", Float64Message, "1 when all steps are done"),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start at the first step."""
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Read the events of the arms, and send the next commands when the last ones are done.

        Raises SessionError if a command is refused or takes too long.
        """
        for name in self._commands:
            self._outputs[name] = ()
        self._receive(inputs)
        now = self._now
        if now.done:
            return self._outputs
        step = self.params.steps[now.step]
        if now.begun_ns < 0:
            self._begin(step, t)
        elif self._is_over(step, t):
            now.step, now.begun_ns = now.step + 1, -1
            now.done = now.step == len(self.params.steps)
        return self._outputs

    def _begin(self, step: Step, t: int) -> None:
        self._now.begun_ns = t
        if isinstance(step, SetPower | SetFlow):
            self._levels[step.output.name][0] = step.level
        for command in _commands(step):
            port, message = command.message()
            self._outputs[port] += (message,)
            self._busy[self._arms.index(command.arm)] = (
                0.0 if isinstance(command, SetSpeed | CloseClip) else 1.0
            )

    def _receive(self, inputs: Inputs) -> None:
        for i, arm in enumerate(self._arms):
            for kind in ("error", "warning"):
                for message in inputs.events(f"{arm}/{kind}"):
                    raise SessionError(
                        f"routine '{self.name}', step {self._now.step}: {cast('StringMessage', message).data}"
                    )
            for message in inputs.events(f"{arm}/operating_state"):
                busy = cast("OperatingState", message).is_busy
                if self._busy[i]:
                    self._busy[i] = 2.0 if busy else 0.0 if self._busy[i] == 2.0 else 1.0

    def _is_over(self, step: Step, t: int) -> bool:
        if isinstance(step, SetPower | SetFlow):
            return True
        if isinstance(step, Wait):
            return t - self._now.begun_ns >= step.time
        if t - self._now.begun_ns > self.params.limit:
            late = ", ".join(arm for arm, busy in zip(self._arms, self._busy, strict=True) if busy)
            raise SessionError(
                f"routine '{self.name}', step {self._now.step}: {late} not done within"
                f" {self.params.limit / 1e9:g} s"
            )
        return not self._busy.any()


def _commands(
    step: Step,
) -> Iterator[
    MoveTip | MoveJoints | MoveJaw | MoveHand | ChangeState | SetSpeed | CloseClip | ExchangeInstrument
]:
    """Yield the commands of a step."""
    if isinstance(step, Together):
        yield from step.orders
    elif not isinstance(step, Wait | SetPower | SetFlow):
        yield step
