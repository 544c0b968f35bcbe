"""Teleoperation as a participant: one hand, one arm. A bimanual console is two of them."""

from __future__ import annotations

from typing import Any, ClassVar, cast

import numpy as np

from controllers.teleoperation.contact_model import ContactModelBuilder
from controllers.teleoperation.engagement import Engagement, Phase
from controllers.teleoperation.jaw import JawGhost
from controllers.teleoperation.params import TeleoperationParams
from controllers.teleoperation.ports import teleoperation_ports
from controllers.teleoperation.pose_law import PoseLaw
from controllers.teleoperation.velocity_law import advance, twist_in_tip
from controllers.teleoperation.view import View
from hub.participant import Inputs, Outputs, Params, Setup, Stepped, restore_arrays, state_hash
from robots import rotation
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.ros import BoolMessage, Header, JointState, Joy, StringMessage, Time
from schemas.trocar_msgs import ContactModel
from schemas.vectors import Vector

__all__ = ["Teleoperation"]

_LOCKS = ("lock_rotation", "lock_translation")
_POSITION, _ORIENTATION = slice(0, 3), slice(3, 7)
"""Of a pose."""
_FOLLOWS, _HOLDS = BoolMessage(data=True), BoolMessage(data=False)


class Teleoperation(Stepped):
    """The hand `master` leads the tip by the pose law or the velocity law while it is engaged; else the arm
    holds.
    """

    params_model: ClassVar[type[Params]] = TeleoperationParams
    params: TeleoperationParams

    def __init__(self, name: str, params: TeleoperationParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._chain, n = params.chain, len(params.chain.joints)
        self._law = (
            PoseLaw(params.chain, turns=params.orientation == "follow") if params.law == "pose" else None
        )
        self._view, self._engagement = View(params), Engagement(params)
        self._ghost = None if params.tool.jaw is None else JawGhost(params.tool.jaw)
        self._contact = ContactModelBuilder(params.force, params.planes)
        self._memory = np.zeros(n + 29)
        parts = np.split(self._memory, [n, n + 7, n + 14, n + 21, n + 23, n + 25, n + 26, n + 27, n + 28])
        (
            self._command,
            self._goal,
            self._tip,
            self._hand,
            self._locks,
            scales,
            self._started,
            self._told,
            self._shared,
            self._relocked,
        ) = parts
        self._scale, self._heard = np.split(scales, 2)
        self._jaw = np.zeros(len(params.tool.jaw_joints))
        self._state = (
            self._memory,
            self._jaw,
            self._contact.state,
            *self._engagement.state,
            *(() if self._law is None else (self._law.state,)),
            *(() if self._ghost is None else (self._ghost.state,)),
        )
        self._outputs: dict[str, Any] = {"servo_jp": self._command, "goal_cp": self._goal}
        self._streams = {f"{params.arm}/servo_jp": self._command}
        if self._ghost is not None:
            self._outputs["jaw/servo_jp"] = self._streams[f"{params.arm}/jaw/servo_jp"] = self._jaw

    @property
    def ports(self) -> tuple[Port, ...]:
        """The hand (`master...`, `buttons`, `gripper`), the arm (`measured_js`, ...) and the `scale` in;
        commands, `contact` and what happens out.
        """
        return teleoperation_ports(self.params)

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with the arm held where the parameters say."""
        self._stand_at(np.array(self.params.start), np.array([self.params.jaw, 0.0]))
        self._scale[0] = self._heard[0] = self.params.scale
        self._told[0] = -1.0
        self._outputs |= {
            "contact": ContactModel(header=Header()),
            "following": _HOLDS,
            "state": (),
            "warning": (),
            **dict.fromkeys(self._streams, ()),
        }
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Move the command after the hand if it leads; hold it if nobody does."""
        self._hear(inputs)
        if not self._holds_command:
            self._stand_at(
                inputs["measured_js"], inputs["jaw/measured_js"] if self._ghost is not None else self._jaw
            )
            self._started[0] = 1.0
        warnings = self._heed_scale(float(inputs["scale"][0]))
        to_base, gripper, seconds = (
            self._view.hand_in_base(inputs["base_in_view"]),
            float(inputs["gripper"][0]),
            h * 1e-9,
        )
        turned = rotation.product(to_base, inputs["master"][3:])
        heard = not inputs.stale("master") and (self._law is not None or not inputs.stale("master_twist"))
        self._engagement.step(turned, self._tip[3:], gripper, seconds, heard=heard)
        if self._engagement.phase is Phase.ENABLED:
            self._lead(inputs, to_base, seconds)
        self._lead_jaw(gripper, seconds)
        self._tell(warnings + self._engagement.warnings)
        self._stream(Time.from_ns(t + h))
        period = max(self.params.contact_period, h)
        if not (t + h) % period:
            self._outputs["contact"] = self._feel(inputs, to_base, Time.from_ns(t + h), period * 1e-9)
        return self._outputs

    @property
    def _holds_command(self) -> bool:
        """Whether the command stays what it was; else it goes where the arm is.

        An arm with a controller of its own may be moved by others meanwhile.
        """
        follows = self._engagement.phase is Phase.ENABLED
        return bool(self._started[0]) and self._engagement.arm_is_ready and (follows or not self._shared[0])

    def _hear(self, inputs: Inputs) -> None:
        """Take what buttons and arm say."""
        for message in inputs.events("operating_state"):
            self._engagement.hear_arm(cast("OperatingState", message))
            self._shared[0] = 1.0
        for i, what in enumerate(_LOCKS):
            for wish in cast("tuple[BoolMessage, ...]", inputs.events(what)):
                self._locks[i], self._relocked[0] = wish.data, 1.0
        for joy in cast("tuple[Joy, ...]", inputs.events("buttons")):
            self._engagement.hear_buttons(joy)
            if self._ghost is not None and joy.buttons.size > self.params.buttons.jaw:
                self._ghost.press(pressed=joy.buttons[self.params.buttons.jaw] != 0)

    def _stand_at(self, positions: Vector, jaw: Vector) -> None:
        """Let the command be where arm and jaw are, or as near to it as their ranges allow; the arrays begin
        with the positions.
        """
        self._command[:] = np.clip(positions[: len(self._command)], self._chain.lower, self._chain.upper)
        self._find_tip()
        self._goal[:] = self._tip
        if self._ghost is not None:
            self._jaw[:] = jaw[: len(self._jaw)]
            self._ghost.stand_at(float(jaw[0]))
            self._jaw[0] = self._ghost.angle[0]

    def _find_tip(self) -> None:
        """Put the tip to where the command has it: x, y, z, qx, qy, qz, qw in the arm's base frame."""
        tip = self._chain.forward(self._command)
        self._tip[:3], self._tip[3:] = tip[:3, 3], rotation.from_matrix(tip)

    def _heed_scale(self, scale: float) -> list[str]:
        """Take the scale; return what is wrong with it, once."""
        news, self._heard[0] = scale != self._heard[0], scale
        if 0.0 < scale <= 1.0:
            self._scale[0] = scale
            return []
        return (
            [f"scale {scale:g} is refused, allowed are over 0 to 1; it stays {self._scale[0]:g}"]
            if news
            else []
        )

    def _lead(self, inputs: Inputs, to_base: Vector, seconds: float) -> None:
        """Move the command after the hand."""
        hand, scale = inputs["master"], float(self._scale[0])
        if self._law is None:
            twist = twist_in_tip(hand[3:], inputs["master_twist"], scale)
            self._command[:] = advance(self._chain, self._command, twist, seconds)
            self._find_tip()
            return
        if self._engagement.takes_over or self._relocked[0]:
            self._hand[:], self._relocked[0] = hand, 0.0
            self._law.engage(hand, self._tip, to_base, scale)
        for lock, part in zip(self._locks, (_ORIENTATION, _POSITION), strict=True):
            if not lock:
                self._hand[part] = hand[part]
        self._command[:] = self._law.step(
            self._command, self._hand, self._tip, to_base, scale, seconds * self._chain.velocity
        )
        self._find_tip()

    def _lead_jaw(self, gripper: float, seconds: float) -> None:
        """Let the jaw follow with the arm, and hold with it."""
        if self._ghost is None:
            return
        if self._engagement.phase is Phase.ENABLED:
            self._ghost.follow(gripper, seconds)
        else:
            self._ghost.release()
        self._jaw[0] = self._ghost.angle[0]

    def _tell(self, warnings: list[str]) -> None:
        """Say what the arm does."""
        phase = self._engagement.phase
        follows = phase is Phase.ENABLED
        self._goal[:] = self._law.goal if follows and self._law is not None else self._tip
        self._outputs["following"] = _FOLLOWS if follows else _HOLDS
        self._outputs["state"] = () if phase == self._told[0] else (StringMessage(data=phase.name),)
        self._outputs["warning"] = tuple(StringMessage(data=warning) for warning in warnings)
        self._told[0] = phase

    def _stream(self, stamp: Time) -> None:
        """Send the commands to the arm's controller while it follows, and nothing else."""
        follows = self._engagement.phase is Phase.ENABLED
        for port, positions in self._streams.items():
            self._outputs[port] = (_positions(positions, stamp),) if follows else ()

    def _feel(self, inputs: Inputs, to_base: Vector, stamp: Time, elapsed: float) -> ContactModel:
        """Return what the hand is to feel, `elapsed` seconds after the last time."""
        hand, tip = inputs["master"], self._tip
        if self._law is None:  # as the hand's own frame is the tip's own
            to_base = rotation.product(tip[3:], rotation.conjugate(hand[3:] / np.linalg.norm(hand[3:])))
        planes = self._contact.planes(
            hand[:3],
            tip[:3],
            rotation.matrix(to_base),
            float(self._scale[0]),
            following=self._engagement.phase is Phase.ENABLED,
            tip_wrench=inputs["tip_wrench"],
            rigid_wrench=inputs["rigid_wrench"],
            elapsed=elapsed,
        )
        return ContactModel(header=Header(stamp=stamp), planes=planes)

    def state_hash(self) -> int:
        """Return the hash of the commands, the references, and who leads."""
        return state_hash(*self._state)

    def save(self) -> bytes:
        """Return the commands, the references, and who leads."""
        return b"".join(array.tobytes() for array in self._state)

    def restore(self, state: bytes) -> None:
        """Return to a saved state. Raises StateError if it has the wrong size."""
        restore_arrays(self.name, self._state, state)

    def close(self) -> None:
        """Nothing is held."""


def _positions(values: Vector, stamp: Time) -> JointState:
    """Return joint positions as a message, which needs no check: they are within the joints' ranges."""
    none = np.zeros(0)
    return JointState.model_construct(
        header=Header.model_construct(stamp=stamp, frame_id=""),
        name=[],
        position=values.copy(),
        velocity=none,
        effort=none,
    )
