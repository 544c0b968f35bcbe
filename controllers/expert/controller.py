"""The expert as a participant: measurements in, commands of its hands out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, cast

import numpy as np

from controllers.expert.chore import Chore
from controllers.expert.hand import HandPhase, RobotHand
from controllers.expert.params import ExpertParams
from controllers.expert.peg_board import PegBoard
from controllers.expert.pick_and_place import PickAndPlace
from controllers.expert.ports import EVENTS, PROGRESS, expert_ports
from controllers.expert.progress import ObservedObjects, Progress, Verdict
from controllers.expert.team import Team
from controllers.expert.transfer import Transfer
from controllers.motion.frames import base_in_world
from controllers.motion.params import PsmParams
from hub.participant import Controller, Inputs, Outputs, Params, Setup
from robots.dvrk.parameters import ArmName
from robots.training.fixtures import DishParams
from robots.transform import pose_to_matrix
from schemas.errors import SessionError
from schemas.ports import Port
from schemas.ros import StringMessage

__all__ = ["Expert"]

_VERDICTS = {
    Verdict.NOT_REACHABLE: "is not reachable",
    Verdict.LOST: "has fallen off the table",
    Verdict.BLOCKED: "is blocked: jaws have closed on it too often",
}


class Expert(Controller):
    """Carries the objects of a training scene to their targets."""

    params_model: ClassVar[type[Params]] = ExpertParams
    params: ExpertParams

    def __init__(self, name: str, params: ExpertParams) -> None:
        super().__init__(name, params)
        chore = self._chore = _chore(params)
        self._progress, self._seen = Progress(), ObservedObjects(n=len(chore.objects))
        self._team = Team(chore, self._seen, self._progress, hand_over=params.hand_over)
        self._hands = [Transfer(self._hand(arm), self._team, len(chore.objects)) for arm in params.hands]
        for each in self._hands:
            self._team.add(each)
        self.keep(
            self._progress,
            self._seen,
            *(part for each in self._hands for part in (each.state, each.refusals)),
        )
        self._outputs: dict[str, Any] = {field: self._progress.part(field) for field in PROGRESS}
        self._outputs |= {f"{each.hand.arm}/phase": each.state.part("phase") for each in self._hands}

    def _hand(self, arm: ArmName) -> RobotHand:
        params = self.params
        held = cast("PsmParams", params.arms.present_arms[arm])
        if held.tool.jaw is None:
            raise SessionError(f"expert '{self.name}': {arm} holds {held.tool.name}, which has no jaw")
        return RobotHand(arm, base_in_world(arm, params), held.chain, held.tool.jaw)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Measured tips and jaws and the objects' poses and holders in; commands and progress out."""
        return expert_ports([each.hand.arm for each in self._hands], self._chore.objects)

    @property
    def ended(self) -> str:
        """Reason to end the session: the task is done, or nothing more can be done."""
        if not self.params.end or not self._progress.over:
            return ""
        return (
            "the task is done"
            if self._progress.done
            else f"nothing more can be done: {self._describe_left()}"
        )

    def configure(self, setup: Setup) -> Outputs:
        """Start with idle hands."""
        for each in self._hands:
            each.hand.period = setup.period_ns * 1e-9
            self._outputs |= {f"{each.hand.arm}/servo_cp": (), f"{each.hand.arm}/jaw/move_jp": ()}
        self._outputs["status"] = ()
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Read measurements, advance every hand, and send the commands.

        Raises SessionError if a command to a hand with an object is refused.
        """
        self._sense(inputs)
        for each in self._hands:
            if t == 0:
                each.hand.stay()
            each.step()
        for each in self._hands:
            arm = each.hand.arm
            self._outputs[f"{arm}/servo_cp"] = (each.hand.advance(settle=each.settles),)
            self._outputs[f"{arm}/jaw/move_jp"] = each.hand.jaw_commands()
        self._update_progress()
        return self._outputs

    def _update_progress(self) -> None:
        """Update progress and verdicts, and begin the next leg if a leg is over."""
        team, progress, seen = self._team, self._progress, self._seen
        team.judge()
        verdicts = seen.verdicts.tolist()
        progress.not_reachable = verdicts.count(Verdict.NOT_REACHABLE)
        progress.lost, progress.blocked = verdicts.count(Verdict.LOST), verdicts.count(Verdict.BLOCKED)
        if not progress.over:
            done = [team.is_done(index) for index in range(len(verdicts))]
            progress.placed = sum(done)
            settled = all(is_done or verdict for is_done, verdict in zip(done, verdicts, strict=True))
            if settled and all(each.state.phase is HandPhase.IDLE for each in self._hands):
                self._end_leg()
        self._outputs["status"] = tuple(self._new_verdicts())

    def _end_leg(self) -> None:
        progress, seen = self._progress, self._seen
        legs, is_whole = self.params.legs, progress.placed == len(seen.tries)
        seen.tries[:] = 0.0
        if progress.placed and (legs is None or progress.leg + 1 < legs):
            progress.leg += 1
            seen.verdicts[seen.verdicts == Verdict.BLOCKED] = Verdict.NONE
        else:
            progress.over, progress.done = True, is_whole

    def _new_verdicts(self) -> Iterator[StringMessage]:
        """Yield a sentence for each new verdict."""
        seen = self._seen
        for index in np.flatnonzero(seen.verdicts != seen.said).tolist():
            if seen.verdicts[index]:
                yield StringMessage(data=self._verdict_sentence(index))
        seen.said[:] = seen.verdicts

    def _describe_left(self) -> str:
        return "; ".join(
            self._verdict_sentence(index) for index in np.flatnonzero(self._seen.verdicts).tolist()
        )

    def _verdict_sentence(self, index: int) -> str:
        seen = self._seen
        why = _VERDICTS[Verdict(int(seen.verdicts[index]))]
        x, y, z = (1e3 * seen.poses[index, :3, 3]).tolist()
        return f"{self._chore.objects[index]} {why}, at ({x:.0f}, {y:.0f}, {z:.0f}) mm"

    def _sense(self, inputs: Inputs) -> None:
        for each in self._hands:
            arm = each.hand.arm
            for event in EVENTS:
                for message in inputs.events(f"{arm}/{event}"):
                    phase, text = each.state.phase.name.lower(), cast("StringMessage", message).data
                    if not each.refuse():
                        raise SessionError(f"expert '{self.name}', {arm} in phase '{phase}': {text}")
            each.hand.sense(inputs[f"{arm}/local/measured_cp"], float(inputs[f"{arm}/jaw/measured_js"][0]))
        for i, name in enumerate(self._chore.objects):
            holder = float(inputs[f"objects/{name}/held_by"][0])
            self._seen.observe(
                i, pose_to_matrix(inputs[f"objects/{name}/pose"]), holder, self._hands[0].hand.period
            )


def _chore(params: ExpertParams) -> Chore:
    if params.goals:
        dishes = {name: dish for name, dish in params.fixtures.items() if isinstance(dish, DishParams)}
        return PickAndPlace(params.goals, dishes)
    if params.board is None:
        raise SessionError("no board")
    return PegBoard(params.rings, params.board)
