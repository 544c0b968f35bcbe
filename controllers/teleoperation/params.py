"""Parameters of a teleoperation. SI units, radians, quaternions (x, y, z, w)."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from controllers.motion.params import Arms, PsmParams
from controllers.teleoperation.contact_model import ForceParams, PlanesParams
from hub.participant import Params
from robots.dvrk import ecm, psm, si
from robots.dvrk.mounted.psm_tool import DEFAULT_INSTRUMENT, PsmTool
from robots.dvrk.parameters import ArmName, InstrumentName, MountedPositions, UnitQuaternion, home
from schemas.quantity import Angle, Duration, Power

__all__ = ["Buttons", "TeleoperationParams"]


def _orientation(data: dict[str, Any]) -> str:
    return "follow" if data.get("law") == "velocity" else "hold"


def _instrument_by_arms(data: dict[str, Any]) -> str:
    """Return the led arm's instrument by `arms`, if named there."""
    arms: Arms | None = data["arms"]
    led = None if arms is None else arms.present_arms.get(data["arm"])
    return led.instrument if isinstance(led, PsmTool) else DEFAULT_INSTRUMENT


def _tip_by_arms(data: dict[str, Any]) -> Path | None:
    """Return the file of the led arm's fingers by `arms`, if stated there."""
    arms: Arms | None = data["arms"]
    led = None if arms is None else arms.present_arms.get(data["arm"])
    return led.tip if isinstance(led, PsmTool) else None


def _generation_by_arms(data: dict[str, Any]) -> si.Generation:
    """Return the led arm's generation by `arms`, if stated there."""
    arms: Arms | None = data["arms"]
    led = None if arms is None else arms.present_arms.get(data["arm"])
    return led.generation if isinstance(led, PsmTool) else "classic"


class Buttons(Params):
    """Functions of the hand's buttons, counted from 0."""

    clutch: int = Field(
        default=0,
        ge=0,
        description=(
            "frees the hand while it is pressed or, with `engage: held`, leads the arm only while it is"
            " pressed"
        ),
    )
    jaw: int = Field(
        default=1, ge=0, description="closes the jaw while it is pressed, unless a `gripper` is connected"
    )
    pedal: int = Field(
        default=2,
        ge=0,
        description=(
            "while it is pressed and the arm follows, the generator gives `power`, or the sucker sucks"
        ),
    )
    rinse: int = Field(default=3, ge=0, description="likewise, lets saline out of a suction irrigator")


class _LedArm(Params):
    """The led arm; a base class, so the arms are validated before values are taken from the arms."""

    arms: Arms | None = Field(
        default=None, description="as in the motion controller; they say what the led arm holds"
    )
    arm: ArmName = "PSM1"


class TeleoperationParams(PsmTool, _LedArm):
    """Leading of an arm by a hand; the fingers of a MUSHA hand on the arm stay folded."""

    open_to_pages: ClassVar[bool] = True

    generation: si.Generation = Field(
        default_factory=_generation_by_arms,
        description="of the led arm; default: as in `arms`, without them the Classic",
    )
    instrument: InstrumentName = Field(
        default_factory=_instrument_by_arms,
        description=(
            "what the arm holds: name or number, such as 400006; default: as in `arms`, without them"
            f" {DEFAULT_INSTRUMENT}"
        ),
    )
    tip: Path | None = Field(
        default_factory=_tip_by_arms,
        description="file of `trocar instruments import`; default: as in `arms`",
    )
    start: MountedPositions = Field(
        default_factory=home,
        description=f"the command until measured_js is there: {', '.join(psm.JOINT_NAMES)}",
    )
    jaw: Angle = Field(default=0.0, description="opening of the jaw until jaw/measured_js is there")
    law: Literal["pose", "velocity"] = Field(
        default="pose",
        description=(
            "the tip moves as the hand does, scaled; or the hand's twist in its own frame is the tip's in its"
            " own"
        ),
    )
    scale: float = Field(
        default=0.2,
        gt=0.0,
        le=1.0,
        description="metres of the tip per metre of the hand; also an input, to be changed while it runs",
    )
    orientation: Literal["hold", "follow"] = Field(
        default_factory=_orientation,  # pyright: ignore[reportArgumentType]  # validated like any value
        description=(
            "whether the tip keeps its orientation or turns with the hand; default: hold with `law: pose`,"
            " follow with `law: velocity`"
        ),
        validate_default=True,
    )
    view: Literal["base", "camera", "display"] = Field(
        default="base",
        description=(
            "what the hand's frame is registered to: the arm's base frame; the picture of the camera in whose"
            " frame `base_in_view` is, so that right, up and away on the desk (x away, y left, z up) are"
            " right, up and away in the picture; or the display, whose axes correspond to those of the"
            " camera's frame, for masters of a dVRK"
        ),
    )
    registration: UnitQuaternion = Field(
        default=(0.0, 0.0, 0.0, 1.0),
        description=(
            "orientation of the master's frame in the arm's base frame or, with `view: camera`, in the"
            " desk's, with `view: display` in the display's"
        ),
    )
    endoscope: ecm.Endoscope = Field(default="straight", description="with `view: camera`: as the ECM has it")
    tip_frame: ecm.TipFrame = Field(
        default="kinematic",
        description="with `view: camera`: as the ECM in whose frame `base_in_view` is has it",
    )
    engage: Literal["released", "held"] = Field(
        default="released",
        description=(
            "the arm follows unless the clutch button is pressed, or only while it is held: dead-man and"
            " clutch in one"
        ),
    )
    buttons: Buttons = Buttons()
    power: Power = Field(
        default=60.0, gt=0, le=400, description="of the generator at the tissue, while the pedal is pressed"
    )
    align: Literal["relative", "gate"] = Field(
        default="relative",
        description=(
            "the tip turns from where it is, or follows only once the master is turned as the tip is and a"
            " hand holds it"
        ),
    )
    force: ForceParams = Field(default=ForceParams(), description="what the hand feels, by `contact`")
    planes: PlanesParams = ()
    contact_period: Duration = Field(
        default=0, ge=0, description="of `contact`, a multiple of the period; 0: at every step"
    )
    max_age: Duration = Field(
        default=100_000_000, gt=0, description="the arm holds when the master has been silent for longer"
    )

    @property
    def variants(self) -> tuple[Self, ...]:
        """The teleoperation with the mounted instrument, then with each spare of the arm by `arms`."""
        return self, *self._with_spares

    @cached_property
    def _with_spares(self) -> tuple[Self, ...]:
        led = None if self.arms is None else self.arms.present_arms.get(self.arm)
        fields = {name: getattr(self, name) for name in type(self).model_fields}
        return tuple(
            self.model_construct(self.model_fields_set, **(fields | {"instrument": spare}))
            for spare in (led.spares if isinstance(led, PsmParams) else ())
        )

    @model_validator(mode="after")
    def _holds_what_the_arms_say(self) -> Self:
        if self.arms is None:
            return self
        led = self.arms.present_arms.get(self.arm)
        if isinstance(led, PsmTool) and led.instrument != self.instrument:
            raise ValueError(
                f"instrument '{self.instrument}', but in `arms` {self.arm} holds '{led.instrument}'; state it"
                " once, in `arms`"
            )
        if isinstance(led, PsmTool) and led.tip != self.tip:
            raise ValueError(
                f"tip '{self.tip}', but in `arms` {self.arm} has '{led.tip}'; state it once, in `arms`"
            )
        if led is None and "instrument" not in self.model_fields_set:
            raise ValueError(
                f"`arms` has {', '.join(self.arms.present_arms)} and not {self.arm}, which the hand"
                " leads; add it there, or set `arm`"
            )
        return self

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.law == "velocity" and self.orientation == "hold":
            raise ValueError(
                "'law: velocity' turns the tip with the hand; leave out 'orientation: hold', or take 'law:"
                " pose'"
            )
        if self.law == "velocity" and len(self.chain.joints) < 6:
            raise ValueError(
                f"'law: velocity' inverts the Jacobian, but with '{self.instrument}' the arm has"
                f" {len(self.chain.joints)} joints; take 'law: pose'"
            )
        if self.align == "gate" and self.orientation == "hold":
            raise ValueError(
                "'align: gate' compares orientations, which 'orientation: hold' leaves apart; set"
                " 'orientation: follow'"
            )
        return self
