"""The expert as a participant: its hands, what they measure, and the commands that they send."""

from __future__ import annotations

from typing import Any, ClassVar, cast

from controllers.expert.chores import Chore, PegBoard, PickAndPlace
from controllers.expert.hand import Hand, Phase, framed
from controllers.expert.params import ExpertParams
from controllers.expert.ports import EVENTS, expert_ports
from controllers.expert.transfer import Progress, Role, Seen, Transfer
from controllers.motion.frames import base_in_world
from controllers.motion.params import MotionParams, PsmParams
from hub.participant import Controller, Inputs, Outputs, Params, Setup
from robots.training.fixtures import DishParams
from schemas.errors import SessionError
from schemas.ports import Port
from schemas.ros import StringMessage

__all__ = ["Expert"]


class Expert(Controller):
    """Carries the things of a training scene where they belong."""

    params_model: ClassVar[type[Params]] = ExpertParams
    params: ExpertParams

    def __init__(self, name: str, params: ExpertParams) -> None:
        super().__init__(name, params)
        self._chore = _chore(params)
        self._progress, self._seen = Progress(), Seen(n=len(self._chore.things))
        self._transfers = self._hands()
        self.keep(self._progress, self._seen, *(each.state for each in self._transfers))
        self._outputs: dict[str, Any] = {
            field: self._progress.part(field) for field in ("done", "placed", "attempts", "dropped")
        }
        self._outputs |= {f"{each.hand.arm}/phase": each.state.part("phase") for each in self._transfers}

    def _hands(self) -> list[Transfer]:
        params = self.params
        stands = MotionParams(arms=params.arms, mounting=params.mounting, setup_joints=params.setup_joints)
        roles: tuple[Role, ...] = ("taker", "giver") if params.hand_over else ("alone", "alone")
        transfers = list[Transfer]()
        for arm, role in zip(params.hands, roles, strict=False):
            held = cast("PsmParams", params.arms.driven[arm])
            if held.tool.jaw is None:
                raise SessionError(f"expert '{self.name}': {arm} holds {held.tool.name}, which has no jaw")
            hand = Hand(arm, base_in_world(arm, stands), held.chain, held.tool.jaw)
            transfers.append(Transfer(hand, role, self._chore, self._seen, self._progress))
        if len(transfers) == 2:
            transfers[0].other, transfers[1].other = transfers[1], transfers[0]
        return transfers

    @property
    def ports(self) -> tuple[Port, ...]:
        """Measured tips and jaws and the things' poses and holders in; commands and progress out."""
        return expert_ports([each.hand.arm for each in self._transfers], self._chore.things)

    @property
    def ended(self) -> str:
        """Ends the session once all is where it belongs and the hands are idle."""
        return "the task is done" if self._progress.done and self.params.end else ""

    def configure(self, setup: Setup) -> Outputs:
        """Start with idle hands."""
        for each in self._transfers:
            each.hand.period = setup.period_ns * 1e-9
            self._outputs |= {f"{each.hand.arm}/servo_cp": (), f"{each.hand.arm}/jaw/move_jp": ()}
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Read what is measured, let every hand do what comes next, and send the commands.

        Raises SessionError if a command is refused.
        """
        self._sense(inputs)
        for each in self._transfers:
            if t == 0:
                each.hand.stay()
            each.step()
        for each in self._transfers:
            arm = each.hand.arm
            self._outputs[f"{arm}/servo_cp"] = (each.hand.advance(settle=each.settles),)
            self._outputs[f"{arm}/jaw/move_jp"] = each.hand.jaw_commands()
        poses, idle = self._seen.poses, all(each.state.phase is Phase.IDLE for each in self._transfers)
        self._progress.placed = sum(self._chore.is_done(i, poses) for i in range(len(poses)))
        self._progress.done = self._progress.done or (idle and self._progress.placed == len(poses))
        return self._outputs

    def _sense(self, inputs: Inputs) -> None:
        for each in self._transfers:
            arm = each.hand.arm
            for event in EVENTS:
                for message in inputs.events(f"{arm}/{event}"):
                    phase, text = each.state.phase.name.lower(), cast("StringMessage", message).data
                    raise SessionError(f"expert '{self.name}', {arm} in phase '{phase}': {text}")
            each.hand.sense(inputs[f"{arm}/local/measured_cp"], float(inputs[f"{arm}/jaw/measured_js"][0]))
        for i, thing in enumerate(self._chore.things):
            self._seen.poses[i] = framed(inputs[f"objects/{thing}/pose"])
            self._seen.holders[i] = inputs[f"objects/{thing}/held_by"][0]


def _chore(params: ExpertParams) -> Chore:
    if params.goals:
        dishes = {name: dish for name, dish in params.fixtures.items() if isinstance(dish, DishParams)}
        return PickAndPlace(params.goals, dishes)
    if params.board is None:
        raise SessionError("no board")
    return PegBoard(params.rings, params.board)
