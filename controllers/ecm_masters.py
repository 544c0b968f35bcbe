"""Both masters drag the picture: they lead the endoscope, as with the camera pedal of a dVRK.

The law of jhu-dvrk/sawIntuitiveResearchKit, mtsTeleOperationECM.cpp (RunEnabled). With c the middle between
the masters in the display's frame and u the normal of the plane through both and the display's origin, each
relative to its value when the pedal was pressed:

    a = -angle about y of c,  b = angle about x of c,  i = s (|c0| - |c|),  r = -angle about z of u,    g =
    q0_roll + r
    q = q0 + (a cos g - b sin g,  b cos g + a sin g,  i,  r)

The masters are held at their distance by springs, damped, and turned against the picture, so that both hands
feel as if they held one thing. The reference is the endoscope's setpoint, so the first step moves nothing.
"""

from __future__ import annotations

from typing import ClassVar, cast

import numpy as np
from pydantic import Field

from controllers.ports import NO_TWIST, measured_joints
from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    Value,
    array,
    event_in,
    event_out,
    flag,
    signal_in,
    signal_out,
)
from robots import rotation
from robots.dvrk import crtk, ecm
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.quantity import Duration
from schemas.ros import (
    BoolMessage,
    Header,
    JointState,
    Joy,
    PoseStamped,
    Quaternion,
    StringMessage,
    Time,
    TwistStamped,
    Vector3,
    Wrench,
    WrenchStamped,
)
from schemas.vectors import Vector

__all__ = ["EcmMasters", "EcmMastersParams"]

_MASTERS = ("MTML", "MTMR")
_X, _Y, _Z = np.eye(3)
_SPRING = 150.0
"""N/m between a master and where it was relative to the other one (distanceForceCoeff)."""
_DAMPER = np.array([-10.0, -10.0, -40.0])
"""N s/m along the axes of the display (frictionForceCoeff)."""
_FOLLOWS, _HOLDS = BoolMessage(data=True), BoolMessage(data=False)


class EcmMastersParams(Params):
    """How two masters lead the endoscope."""

    open_to_pages: ClassVar[bool] = True

    scale: float = Field(
        default=1.0, gt=0.0, description="metres of insertion per metre that the masters are pulled"
    )
    max_age: Duration = Field(
        default=100_000_000, gt=0, description="the camera holds when a master has been silent for longer"
    )


class EcmMastersState(Record):
    """The pedal, and the reference from when it was pressed."""

    pressed = flag()
    ready = flag(start=True)
    """Whether the endoscope's arm is ENABLED and homed."""
    follows = flag()
    middle = array(3)
    """Middle between the masters, m."""
    up = array(3)
    """Normal of the plane through the masters and the display's origin."""
    span = array(2)
    """Half of the way between the masters, along the picture's right and along the middle, m."""
    start = array(4)
    """Joint positions of the endoscope."""
    turns = array(2, 4)
    """Orientations of the masters, quaternions (x, y, z, w)."""
    unused = array(2)
    """Kept so that state hashes stay comparable with those of older recordings."""


class EcmMasters(Controller):
    """Two masters, one endoscope.

    It follows while button 0 is held, the arm is ready and the poses of both masters are fresh.
    """

    params_model: ClassVar[type[Params]] = EcmMastersParams
    params: EcmMastersParams

    def __init__(self, name: str, params: EcmMastersParams) -> None:
        super().__init__(name, params)
        self._chain = ecm.chain()
        self._now = EcmMastersState()
        self.keep(self._now)
        self._middle, self._up, self._span = self._now.middle, self._now.up, self._now.span
        self._start, self._turns = self._now.start, dict(zip(_MASTERS, self._now.turns, strict=True))
        self._commands = [f"{master}/{name}" for master in _MASTERS for name in _COMMANDS]
        self._silent: dict[str, Value] = {
            "ECM/servo_jp": (),
            "warning": (),
            **dict.fromkeys(self._commands, ()),
        }

    @property
    def ports(self) -> tuple[Port, ...]:
        """The masters, the pedal and the endoscope's setpoint in; commands to it and to the masters out."""
        age = self.params.max_age
        return (
            *(signal_in(f"{master}/measured_cp", PoseStamped, max_age_ns=age) for master in _MASTERS),
            *(signal_in(f"{master}/measured_cv", TwistStamped, start=NO_TWIST) for master in _MASTERS),
            event_in("buttons", Joy, "button 0: follows while it is held"),
            measured_joints(
                "measured_js", ecm.JOINT_NAMES, "setpoint_js of a motion controller", start=ecm.HOME
            ),
            event_in("operating_state", OperatingState, "of the ECM"),
            event_out("ECM/servo_jp", JointState, "while it follows"),
            *(
                event_out(f"{master}/{name}", type_)
                for master in _MASTERS
                for name, type_ in _COMMANDS.items()
            ),
            signal_out("following", BoolMessage, "whether the endoscope follows"),
            event_out("warning", StringMessage, "why it does not"),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with the pedal released."""
        return self._silent | {"following": _HOLDS}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Follow the masters while the pedal is down."""
        for joy in cast("tuple[Joy, ...]", inputs.events("buttons")):
            if joy.buttons.size:
                self._now.pressed = bool(joy.buttons[0] != 0)
        for state in cast("tuple[OperatingState, ...]", inputs.events("operating_state")):
            self._now.ready = crtk.is_ready(state)
        silent = [master for master in _MASTERS if inputs.stale(f"{master}/measured_cp")]
        before = self._now.follows
        self._now.follows = follows = self._now.pressed and self._now.ready and not silent
        outputs = self._silent | {"following": _FOLLOWS if follows else _HOLDS}
        if before and not follows:
            outputs |= {f"{master}/body/servo_cf": (WrenchStamped(),) for master in _MASTERS}
            if self._now.pressed:
                reason = f"{silent[0]} is silent" if silent else "it is not ENABLED and homed"
                outputs["warning"] = (StringMessage(data=f"ECM holds: {reason}"),)
        if follows:
            left, right = (inputs[f"{master}/measured_cp"] for master in _MASTERS)
            if not before:
                self._engage_masters(left, right, inputs["measured_js"])
                for master in _MASTERS:
                    outputs |= {
                        f"{master}/{name}": (_FOLLOWS,)
                        for name in ("use_gravity_compensation", "body/set_cf_orientation_absolute")
                    }
            outputs |= self._lead(left[:3], right[:3], Time.from_ns(t + h))
            outputs |= self._hold_together(left[:3], right[:3], inputs)
        return outputs

    def _engage_masters(self, left: Vector, right: Vector, endoscope: Vector) -> None:
        """Set the reference to the present poses."""
        self._middle[:], self._up[:], side = _picture_axes(left[:3], right[:3])
        between = right[:3] - left[:3]
        self._span[:] = 0.5 * (side @ between), 0.5 * (self._middle @ between) / np.linalg.norm(self._middle)
        self._start[:] = np.clip(endoscope[:4], self._chain.lower, self._chain.upper)
        for master, pose in zip(_MASTERS, (left, right), strict=True):
            self._turns[master][:] = pose[3:]

    def _lead(self, left: Vector, right: Vector, stamp: Time) -> dict[str, Value]:
        """Return the command to the endoscope, and the orientations at which the masters are held."""
        middle, up, _ = _picture_axes(left, right)
        a, b, r = (
            -_angle_about(_Y, self._middle, middle),
            _angle_about(_X, self._middle, middle),
            -_angle_about(_Z, self._up, up),
        )
        i = self.params.scale * float(np.linalg.norm(self._middle) - np.linalg.norm(middle))
        cos, sin = np.cos(self._start[3] + r), np.sin(self._start[3] + r)
        goal = np.clip(
            self._start + np.array([a * cos - b * sin, b * cos + a * sin, i, r]),
            self._chain.lower,
            self._chain.upper,
        )
        back = rotation.conjugate(
            rotation.product(
                _picture_orientation(goal), rotation.conjugate(_picture_orientation(self._start))
            )
        )
        locks: dict[str, Value] = {
            f"{m}/lock_orientation": (_quaternion(rotation.product(back, turn)),)
            for m, turn in self._turns.items()
        }
        return locks | {"ECM/servo_jp": (JointState(header=Header(stamp=stamp), position=goal),)}

    def _hold_together(self, left: Vector, right: Vector, inputs: Inputs) -> dict[str, Value]:
        """Return the forces on the masters: springs that keep them apart, and dampers."""
        middle, _, side = _picture_axes(left, right)
        right_share, middle_share = self._span.tolist()
        reach = right_share * side + middle_share * middle / np.linalg.norm(middle)
        forces: dict[str, Value] = {}
        for master, goal, at in (("MTML", middle - reach, left), ("MTMR", middle + reach, right)):
            force = _SPRING * (goal - at) + _DAMPER * inputs[f"{master}/measured_cv"][:3]
            wrench = Wrench(force=Vector3(**dict(zip("xyz", force.tolist(), strict=True))))
            forces[f"{master}/body/servo_cf"] = (WrenchStamped(wrench=wrench),)
        return forces


_COMMANDS = {
    name: (crtk.COMMANDS | crtk.MTM_COMMANDS)[name]
    for name in (
        "use_gravity_compensation",
        "body/set_cf_orientation_absolute",
        "body/servo_cf",
        "lock_orientation",
    )
}
"""To each master: ROS type."""


def _picture_axes(left: Vector, right: Vector) -> tuple[Vector, Vector, Vector]:
    """Return the middle between the masters, and up and right in the picture that they hold."""
    middle = 0.5 * (left + right)
    up = np.cross(right - left, middle)
    up /= np.linalg.norm(up)
    side = np.cross(middle, up)
    return middle, up, side / np.linalg.norm(side)


def _angle_about(axis: Vector, one: Vector, other: Vector) -> float:
    """Return the angle (rad) about `axis` from `one` to `other`."""
    one, other = one - (axis @ one) * axis, other - (axis @ other) * axis
    return float(np.arctan2(axis @ np.cross(one, other), one @ other))


def _picture_orientation(q: Vector) -> Vector:
    """Return the orientation of the picture, a quaternion, at joint positions `q`.

    Roll is about z, yaw about y, pitch about x.
    """
    return rotation.product(
        rotation.product(rotation.exp(q[3] * _Z), rotation.exp(q[0] * _Y)), rotation.exp(q[1] * _X)
    )


def _quaternion(value: Vector) -> Quaternion:
    return Quaternion(**dict(zip("xyzw", (value / np.linalg.norm(value)).tolist(), strict=True)))
