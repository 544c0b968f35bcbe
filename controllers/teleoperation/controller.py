"""Teleoperation as a participant: a hand and an arm. A console for two hands has two teleoperations."""

from __future__ import annotations

from typing import Any, ClassVar, cast

import numpy as np

from controllers.teleoperation.contact_model import ContactModelBuilder
from controllers.teleoperation.engagement import Engagement, EngagementPhase
from controllers.teleoperation.led_instrument import LedInstrument
from controllers.teleoperation.params import TeleoperationParams
from controllers.teleoperation.pedals import Pedals
from controllers.teleoperation.ports import has_clips, jaw_joints, teleoperation_ports
from controllers.teleoperation.velocity_law import advance, twist_in_tip
from controllers.teleoperation.view import View
from hub.participant import Controller, Inputs, Outputs, Params, Record, Setup, array, flag, integer, number
from robots import rotation
from robots.limits import TOLERANCE, distinct
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.ros import BoolMessage, EmptyMessage, Header, JointState, Joy, StringMessage, Time
from schemas.trocar_msgs import ContactModel
from schemas.vectors import Vector

__all__ = ["Teleoperation"]

_POSITION, _ORIENTATION = slice(0, 3), slice(3, 7)
"""Parts of a pose."""
_FOLLOWS, _HOLDS = BoolMessage(data=True), BoolMessage(data=False)
_NONE = np.zeros(0)


class TeleoperationState(Record):
    """Commands and settings; poses are (x, y, z, qx, qy, qz, qw)."""

    command = array("n")
    """To the arm's joints."""
    goal = array(7)
    """Goal of the tip, in the arm's base frame."""
    tip = array(7)
    """Tip at the command, in the arm's base frame."""
    hand = array(7)
    """Pose of the hand for the law: locked parts do not change."""
    rotation_locked = flag()
    translation_locked = flag()
    scale = number()
    requested_scale = number()
    """Newest value of the input, valid or not."""
    started = flag()
    published_phase = integer(-1)
    """-1: none was published."""
    shared = flag()
    """Whether the arm publishes an operating state and may have other clients."""
    relocked = flag()
    """Whether a lock was changed since the last reference."""
    jaw = array("jaw")
    """Command to the jaw's joints."""


class HeldState(Record):
    """The instrument of an arm with spares."""

    number = integer()
    """0 for the mounted one, 1 for the first spare."""


class Teleoperation(Controller):
    """The engaged hand `master` leads the tip by the pose law or the velocity law.

    Otherwise the arm holds.
    """

    params_model: ClassVar[type[Params]] = TeleoperationParams
    params: TeleoperationParams

    def __init__(self, name: str, params: TeleoperationParams) -> None:
        super().__init__(name, params)
        self._instruments = tuple(LedInstrument(one) for one in params.variants)
        self._held = HeldState() if len(self._instruments) > 1 else None
        self._take(0)
        self._view, self._engagement = View(params), Engagement(params)
        self._contact = ContactModelBuilder(params.force, params.planes)
        self._pedals = Pedals(params)
        self._now = TeleoperationState(n=len(params.chain.joints), jaw=len(jaw_joints(params)))
        self._command, self._goal, self._tip = self._now.command, self._now.goal, self._now.tip
        self._hand, self._jaw = self._now.hand, self._now.jaw
        self.keep(
            self._now,
            *self._contact.state,
            *self._engagement.state,
            *(state for one in self._instruments for state in one.state),
            *(() if self._held is None else (self._held,)),
            *self._pedals.state,
        )
        self._outputs: dict[str, Any] = {"servo_jp": self._command, "goal_cp": self._goal}
        self._outputs |= self._pedals.outputs
        self._streams = {f"{params.arm}/servo_jp": self._command}
        if self._jaw.size:
            self._outputs["jaw/servo_jp"] = self._streams[f"{params.arm}/jaw/servo_jp"] = self._jaw

    @property
    def ports(self) -> tuple[Port, ...]:
        """Hand, buttons, arm and `scale` in; commands, `contact`, what pedals do, and events out."""
        return *teleoperation_ports(self.params), *self._pedals.ports

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with the arm held at the position of the parameters."""
        self._stand_at(np.array(self.params.start), np.array([self.params.jaw, 0.0]))
        self._now.scale = self._now.requested_scale = self.params.scale
        self._outputs |= {
            "contact": ContactModel(header=Header()),
            "following": _HOLDS,
            "state": (),
            "warning": (),
            **dict.fromkeys(self._streams, ()),
            **({"clip": ()} if has_clips(self.params) else {}),
        }
        return self._outputs

    def _take(self, number: int) -> None:
        """Go on with an instrument: 0 for the mounted one, 1 for the first spare."""
        led = self._instruments[number]
        self._chain, self._frames, self._law = led.chain, led.frames, led.law
        self._ghost, self._trigger = led.ghost, led.trigger
        self._found = b""
        """Bits of the command of `tip`."""

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Let the command follow the leading hand; otherwise hold the command."""
        self._receive(inputs)
        if self._held is not None:
            self._follow_exchange(round(float(inputs["instrument"][0])))
        if not self._holds_command:
            self._stand_at(
                inputs["measured_js"], inputs["jaw/measured_js"] if self._ghost is not None else self._jaw
            )
            self._now.started = True
        warnings = self._set_scale(float(inputs["scale"][0]))
        to_base, gripper, seconds = (
            self._view.hand_in_base(inputs["base_in_view"]),
            float(inputs["gripper"][0]),
            h * 1e-9,
        )
        hand = inputs["master"][3:]
        fresh = not inputs.stale("master") and (self._law is not None or not inputs.stale("master_twist"))
        self._engagement.step(to_base, hand, self._tip[3:], gripper, seconds, fresh=fresh)
        phase = self._engagement.phase
        follows = phase is EngagementPhase.ENABLED
        if follows:
            self._lead(inputs, to_base, seconds)
        self._lead_jaw(gripper, seconds, follows=follows)
        if self._trigger is not None:
            fires = follows and self._trigger.fires(float(self._jaw[0]), seconds)
            self._outputs["clip"] = (EmptyMessage(),) if fires else ()
        elif "clip" in self._outputs:
            self._outputs["clip"] = ()
        self._pedals.step(0 if self._held is None else self._held.number, follows=follows)
        self._publish(phase, warnings + self._engagement.warnings)
        header = Header.model_construct(stamp=Time.from_ns(t + h), frame_id="")
        self._stream(header, follows=follows)
        period = max(self.params.contact_period, h)
        if not (t + h) % period:
            self._outputs["contact"] = self._feel_contact(inputs, to_base, header, period * 1e-9)
        return self._outputs

    def restore(self, state: bytes) -> None:
        """Return to a saved state, with the tip's pose at the saved command."""
        super().restore(state)
        if self._held is not None:
            self._take(self._held.number)
        self._found = self._command.tobytes()

    @property
    def _holds_command(self) -> bool:
        """Whether the command is held; otherwise set to the arm's measured positions.

        An arm with a controller of its own may be moved by another client meanwhile.
        """
        engagement, now = self._engagement, self._now
        return (
            now.started
            and engagement.arm_is_ready
            and (engagement.phase is EngagementPhase.ENABLED or not now.shared)
        )

    def _receive(self, inputs: Inputs) -> None:
        """Read the state of the arm, locks and buttons."""
        if inputs.quiet:
            return
        for message in inputs.events("operating_state"):
            self._engagement.receive_state(cast("OperatingState", message))
            self._now.shared = True
        for lock in cast("tuple[BoolMessage, ...]", inputs.events("lock_rotation")):
            self._now.rotation_locked, self._now.relocked = lock.data, True
        for lock in cast("tuple[BoolMessage, ...]", inputs.events("lock_translation")):
            self._now.translation_locked, self._now.relocked = lock.data, True
        for joy in cast("tuple[Joy, ...]", inputs.events("buttons")):
            self._engagement.receive_buttons(joy)
            self._pedals.receive(joy)
            if self._ghost is not None and joy.buttons.size > self.params.buttons.jaw:
                self._ghost.press(pressed=joy.buttons[self.params.buttons.jaw] != 0)

    def _follow_exchange(self, number: int) -> None:
        """Take over the instrument that the arm holds; -1: hold until there is one."""
        self._engagement.exchanging = number < 0
        if self._held is not None and number >= 0 and number != self._held.number:
            self._held.number = number
            self._take(number)
            self._now.started = False  # the arm stands elsewhere, with another tip

    def _stand_at(self, positions: Vector, jaw: Vector) -> None:
        """Set the command to the measured positions of arm and jaw, clipped to their ranges.

        Both arrays begin with the positions.
        """
        self._command[:] = np.clip(positions[: len(self._command)], self._chain.lower, self._chain.upper)
        self._find_tip()
        self._goal[:] = self._tip
        if self._ghost is not None:
            self._jaw[:] = jaw[: len(self._jaw)]
            self._ghost.stand_at(float(jaw[0]))
            self._jaw[:1] = self._ghost.angle

    def _find_tip(self) -> None:
        """Compute the pose of the tip from the command, unless the command's bits are unchanged."""
        if (command := self._command.tobytes()) == self._found:
            return
        self._found = command
        tip = self._frames(self._command)[-1]
        self._tip[:3], self._tip[3:] = tip[:3, 3], rotation.from_matrix(tip)

    def _set_scale(self, scale: float) -> list[str]:
        """Set the scale; return the reason of a refusal, once."""
        is_new = scale != self._now.requested_scale
        if not is_new and scale == self._now.scale:
            return []
        self._now.requested_scale = scale
        if 0.0 < scale <= 1.0 + TOLERANCE:
            self._now.scale = min(scale, 1.0)
            return []
        value = distinct(scale, 0.0, 1.0)[0]
        refusal = f"scale {value} is refused, allowed is above 0 and up to 1; it stays {self._now.scale:g}"
        return [refusal] if is_new else []

    def _lead(self, inputs: Inputs, to_base: Vector, seconds: float) -> None:
        """Let the command follow the hand."""
        now, hand = self._now, inputs["master"]
        scale = now.scale
        if self._law is None:
            twist = twist_in_tip(hand[3:], inputs["master_twist"], scale)
            self._command[:] = advance(self._chain, self._command, twist, seconds)
            self._find_tip()
            return
        if self._engagement.takes_over or now.relocked:
            self._hand[:], now.relocked = hand, False
            self._law.engage(hand, self._tip, to_base, scale)
        turns, moves = not now.rotation_locked, not now.translation_locked
        if turns and moves:
            self._hand[:] = hand
        elif turns:
            self._hand[_ORIENTATION] = hand[_ORIENTATION]
        elif moves:
            self._hand[_POSITION] = hand[_POSITION]
        self._command[:] = self._law.step(
            self._command, self._hand, self._tip, to_base, scale, seconds * self._chain.velocity
        )
        self._find_tip()

    def _lead_jaw(self, gripper: float, seconds: float, *, follows: bool) -> None:
        """Let the jaw follow while the arm follows, and hold while the arm holds."""
        if self._ghost is None:
            return
        if follows:
            self._ghost.follow(gripper, seconds)
        else:
            self._ghost.release()
        self._jaw[:1] = self._ghost.angle

    def _publish(self, phase: EngagementPhase, warnings: list[str]) -> None:
        """Publish the phase, the commands and warnings."""
        follows = phase is EngagementPhase.ENABLED
        self._goal[:] = self._law.goal if follows and self._law is not None else self._tip
        self._outputs["following"] = _FOLLOWS if follows else _HOLDS
        is_new = phase != self._now.published_phase
        self._outputs["state"] = (StringMessage(data=phase.name),) if is_new else ()
        self._outputs["warning"] = (
            tuple(StringMessage(data=warning) for warning in warnings) if warnings else ()
        )
        if is_new:
            self._now.published_phase = phase

    def _stream(self, header: Header, *, follows: bool) -> None:
        """Send the commands to the arm's controller while the arm follows."""
        for port, positions in self._streams.items():
            leads = follows and (positions is self._command or self._ghost is not None)
            self._outputs[port] = (_positions(positions, header),) if leads else ()

    def _feel_contact(self, inputs: Inputs, to_base: Vector, header: Header, elapsed: float) -> ContactModel:
        """Return the contact model for the hand, `elapsed` seconds after the last model."""
        hand, tip = inputs["master"], self._tip
        if self._law is None:  # as the hand's own frame is the tip's own
            to_base = rotation.product(tip[3:], rotation.conjugate(hand[3:] / np.linalg.norm(hand[3:])))
        planes = self._contact.planes(
            hand[:3],
            tip[:3],
            rotation.matrix(to_base),
            self._now.scale,
            following=self._engagement.phase is EngagementPhase.ENABLED,
            tip_wrench=inputs["tip_wrench"],
            rigid_wrench=inputs["rigid_wrench"],
            elapsed=elapsed,
        )
        return ContactModel.model_construct(header=header, planes=planes)


def _positions(values: Vector, header: Header) -> JointState:
    """Return joint positions as a message, without validation: positions are within the joints' ranges."""
    return JointState.model_construct(
        header=header, name=[], position=values.copy(), velocity=_NONE, effort=_NONE
    )
