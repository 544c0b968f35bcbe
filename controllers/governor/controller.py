"""The governor between a policy and arms: what a policy answers becomes CRTK commands within limits.

It asks for actions by publishing `observation`, decodes the answers that enter on `actions`, and commands
`servo_cp` or `servo_jp` and the jaw of each arm. All answers are samples that entered, so a session is
simulated again without its policy. The arms hold, at their last set-point, while an answer is missing,
invalid or contradicts the answer before, an arm is not ready, or a force is too large. The commands go to the
motion controller of simulated arms or, through a gateway that listens to them, to real arms.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any, ClassVar, cast

import numpy as np

from controllers.governor.answers import Answers
from controllers.governor.arm import GovernedArm
from controllers.governor.params import GovernorParams
from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    choice,
    event_in,
    event_out,
    flag,
    integer,
    signal_out,
)
from robots.policies.actions import ACTIONS
from robots.policies.states import encode_state
from robots.policies.terms import Terms
from schemas.errors import MessageError, MotionError
from schemas.ports import Port
from schemas.ros import Header, StringMessage, Time
from schemas.trocar_msgs import ActionChunk, PolicyObservation
from schemas.vectors import Vector

__all__ = ["Condition", "Governor"]


class Condition(IntEnum):
    """What the governor does."""

    WAITING = 0
    """No answer so far: the arms stay."""
    FOLLOWING = 1
    SILENT = 2
    """The policy is silent: the arms hold."""
    FAULT = 3
    """The policy, or its answer, is invalid: the arms hold."""
    DISAGREEMENT = 4
    """An answer contradicts the answer before: the arms hold."""
    ARM = 5
    """An arm is not ready, silent, or meets too large a force: the arms hold."""


class _State(Record):
    condition = choice(Condition.WAITING)
    asked = integer()
    """Number of the last observation."""
    answered = integer()
    """Number of the observation of the last answer."""
    doubtful = flag()
    """Whether the last two answers contradict each other."""
    faulty = flag()
    """Whether the last answer was a fault."""
    answers = integer()
    faults = integer()
    holds = integer()
    limited = integer()
    late = integer()


class Governor(Controller):
    """Executes the answers of a policy within limits."""

    params_model: ClassVar[type[Params]] = GovernorParams
    params: GovernorParams

    def __init__(self, name: str, params: GovernorParams) -> None:
        super().__init__(name, params)
        contract = params.contract
        self._arms = [GovernedArm(arm, params) for arm in contract.arms]
        self._layout = ACTIONS[contract.action]
        self._width = Terms.of(contract, params.arms.present_arms, params.mounting).width
        self._ask_ns = params.execute * contract.row_ns
        self._state = _State()
        self._answers = Answers(
            len(self._arms),
            self._arms[0].size,
            contract.horizon,
            contract.row_ns,
            params.execution,
            params.execute,
        )
        self.keep(self._state, *(state for arm in self._arms for state in arm.states), *self._answers.state)
        self._counts = {
            name: np.zeros(1) for name in ("condition", "answers", "faults", "holds", "limited", "late")
        }
        self._outputs: dict[str, Any] = {}
        self._warnings: list[str] = []

    @property
    def ports(self) -> tuple[Port, ...]:
        """Answers in, observations and counts out; per arm CRTK's states in, servo commands and clips out."""
        meaning = "number of the condition: 0 waiting, 1 following, 2 silent, 3 fault, 4 disagreement, 5 arm"
        return (
            event_in("actions", ActionChunk, "answers of the policy"),
            event_out("observation", PolicyObservation, "readings at which the policy is asked"),
            event_out("warning", StringMessage, "why the arms hold, and that they follow again"),
            signal_out("condition", description=meaning),
            signal_out("answers", description="answers executed"),
            signal_out("faults", description="answers that were invalid or failed"),
            signal_out("holds", description="times that following ended"),
            signal_out("limited", description="steps in which a limit acted"),
            signal_out("late", description="answers whose rows were all past"),
            *(port for arm in self._arms for port in arm.ports),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Wait for the first answer."""
        return self._publish(0, 0, ask=False)

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Take answers, follow or hold, and ask when it is time."""
        now = self._state
        self._warnings = []
        for arm in self._arms:
            arm.read(inputs)
        for chunk in cast("tuple[ActionChunk, ...]", inputs.events("actions")):
            self._accept(chunk, t)
        condition, reason = self._judge(t, inputs)
        if condition != now.condition:
            if condition is not Condition.FOLLOWING:
                now.holds += now.condition is Condition.FOLLOWING
                self._warnings.append(f"the arms hold: {reason}")
            elif now.condition is not Condition.WAITING:
                self._warnings.append("the arms follow the policy again")
            now.condition = condition
        goals = self._answers.goal(t + h) if condition is Condition.FOLLOWING else None
        if goals is None:
            for arm in self._arms:
                arm.hold()
        else:
            limited = [arm.follow(goal, h * 1e-9) for arm, goal in zip(self._arms, goals, strict=True)]
            now.limited += any(limited)
        is_due = (t + h) // self._ask_ns > t // self._ask_ns or not now.asked
        return self._publish(t, h, ask=is_due and condition is not Condition.ARM)

    def _accept(self, chunk: ActionChunk, t: int) -> None:
        """Take an answer into execution, or count why not."""
        now, asked_ns = self._state, chunk.header.stamp.ns
        if not now.answered < chunk.number <= now.asked or asked_ns > t:
            self._refuse(
                f"an answer to observation {chunk.number}, which is not open: the last answered is"
                f" {now.answered}, the newest {now.asked}; another session's?"
            )
            return
        now.answered = chunk.number
        if chunk.fault:
            self._refuse(chunk.fault)
            return
        try:
            goals = self._decode(chunk)
        except (MessageError, MotionError) as error:
            self._refuse(str(error))
            return
        now.faulty = False
        if asked_ns + len(goals) * self.params.contract.row_ns <= t:
            now.late += 1
            return
        now.answers += 1
        now.doubtful = (
            self._answers.distance(asked_ns, goals[: self.params.execute]) > self.params.disagreement
        )
        if now.doubtful:
            self._answers.forget()
        self._answers.add(asked_ns, goals)

    def _decode(self, chunk: ActionChunk) -> Vector:
        """Return goals, shape (rows, arms, size); raises MessageError or MotionError."""
        rows, rest = divmod(chunk.actions.size, self._width)
        most, tips = self.params.contract.horizon, 7 * len(self._arms)
        if chunk.width != self._width or rest or not 1 <= rows <= most or chunk.tips.size != tips:
            raise MessageError(
                f"an answer of {chunk.actions.size} numbers in rows of {chunk.width}: the contract has 1 to"
                f" {most} rows of {self._width}"
            )
        parts = chunk.actions.reshape(rows, len(self._arms), -1)
        poses = chunk.tips.reshape(-1, 7)
        return np.stack([self._layout.decode(parts[:, i], pose) for i, pose in enumerate(poses)], axis=1)

    def _refuse(self, reason: str) -> None:
        self._state.faults += 1
        self._state.faulty = True
        self._warnings.append(f"the policy's answer is refused: {reason}")

    def _judge(self, t: int, inputs: Inputs) -> tuple[Condition, str]:
        """Return what to do, and the reason for a hold."""
        now = self._state
        for arm in self._arms:
            if reason := arm.reason_to_hold(inputs):
                return Condition.ARM, reason
        if now.faulty:
            return Condition.FAULT, "the last answer is invalid"
        if now.doubtful:
            far = f"{1e3 * self.params.disagreement:g} mm"
            return Condition.DISAGREEMENT, f"two successive answers put a tip more than {far} apart"
        if not self._answers.end_ns:
            return Condition.WAITING, "the policy has not answered"
        if t > self._answers.end_ns + self.params.silence:
            silent = f"{(t - self._answers.end_ns) / 1e6:.0f} ms"
            return Condition.SILENT, f"the rows of the last answer ended {silent} ago"
        return Condition.FOLLOWING, ""

    def _publish(self, t: int, h: int, *, ask: bool) -> Outputs:
        now, outputs = self._state, self._outputs
        outputs["observation"] = (self._observe(t),) if ask else ()
        outputs["warning"] = tuple(StringMessage(data=text) for text in self._warnings)
        for name, count in self._counts.items():
            count[0] = getattr(now, name)
            outputs[name] = count
        for arm in self._arms:
            outputs |= arm.commands(t + h)
        return outputs

    def _observe(self, time_ns: int) -> PolicyObservation:
        readings = [arm.reading for arm in self._arms]
        self._state.asked += 1
        return PolicyObservation(
            header=Header(stamp=Time.from_ns(time_ns), frame_id=self._arms[0].frame),
            number=self._state.asked,
            state=encode_state(self.params.contract.state, readings),
            tips=np.concatenate([reading.tip for reading in readings]),
        )
