"""The MUSHA hand: three under-actuated fingers of three phalanges on the shaft of a PSM.

It replaces wrist and jaw.

Published are three fingers of three phalanges, under-actuation, the modes retractor, grasp and caliper
(palpation), and that the hand folds into a cylinder of 12 mm (Liu et al., "The MUSHA Hand II", IEEE/ASME
Transactions on Mechatronics; Selvaggio et al., International Journal of Medical Robotics 2019, DOI
10.1002/rcs.1981). Lengths, ranges, motors, pulleys and springs are not: those here are ours, see
docs/decisions/0018. SI units, radians.
"""

from __future__ import annotations

from math import pi, radians
from types import MappingProxyType

from robots.dvrk.end_effectors.hand import Hand, Mode, Phalanx
from robots.dvrk.inertia import STEEL_DENSITY
from robots.serial_chain import jerk_limit

__all__ = ["HAND", "TROCAR_RADIUS"]

TROCAR_RADIUS = 0.012 / 2
"""Radius of the cylinder into which the hand folds (Liu et al.)."""

_RADIUS = 0.0024
"""Radius of a phalanx: three of them, two opposed and one at right angles, fit into the trocar up to offset
(1 + 1 / sqrt 2).
"""
_OFFSET = 0.0035
"""Distance of a finger's axis from the shaft's: sqrt 2 times this keeps neighbours apart, this plus the
radius is under that of the trocar.
"""

_PHALANGES = (
    Phalanx("proximal", 0.022, radians(-90.0), radians(45.0), 0.0020, 50e-3, 0.0, contact=0.5),
    Phalanx("middle", 0.016, 0.0, radians(90.0), 0.0016, 5e-3, radians(-12.0), contact=0.5),
    Phalanx("distal", 0.014, 0.0, radians(90.0), 0.0012, 3.75e-3, radians(-12.0), contact=1.0),
)
"""Pulleys get smaller outwards.

The springs of middle and distal joint are to each other as their pulleys, and so are their preloads: both
bend alike. That of the first joint is ten times as stiff, so that what the tendon pulls bends the outer
joints first.
"""

_OUT = radians(-85.0)
"""A finger at right angles to the shaft, all but 5 degrees."""


def _bend_finger(spread: float, bend: float) -> tuple[float, float]:
    """Return closing and spread of a bent finger.

    Its first joint is at `spread`, and the others are both at `bend` > 0 (rad).
    """
    first, middle, distal = _PHALANGES
    tension = middle.stiffness * (bend - middle.rest) / middle.pulley
    closing = spread + bend * (middle.pulley + distal.pulley) / first.pulley
    return closing, spread - first.pulley * tension / first.stiffness


def _closing_mode(*fingers: tuple[tuple[float, float], tuple[float, float]]) -> Mode:
    """Return the mode from closing and spread of each finger, open and closed."""
    opened, closed = zip(*fingers, strict=True)
    return Mode(*(tuple(finger[part] for part in (0, 1) for finger in state) for state in (opened, closed)))


_STRAIGHT, _FAN = (0.0, 0.0), (_OUT, _OUT)
_PARALLEL = _bend_finger(radians(-70.0), radians(35.0)), _bend_finger(0.0, 1e-9)
_CURL = _bend_finger(radians(-60.0), radians(1e-9)), _bend_finger(radians(-15.0), radians(80.0))

_MODES = {
    "folded": _closing_mode(*[(_STRAIGHT, _STRAIGHT)] * 3),
    "retractor": _closing_mode(*[(_FAN, _STRAIGHT)] * 3),
    "grasp": _closing_mode(*[_CURL] * 3),
    "caliper": _closing_mode(_PARALLEL, _PARALLEL, (_FAN, _FAN)),
}
"""folded: through the trocar. retractor: straight fingers fan out, over half a turn. grasp: all curl about
what lies between them. caliper: the distal phalanges of the two opposed fingers close on what is measured,
parallel to each other all the way, the third finger is out of the way.
"""

_VELOCITY, _ACCELERATION = radians(180.0), radians(720.0)
"""Limits of a motor: the range of a finger in a second; the acceleration is that of wrist and jaw
(`robots.dvrk.end_effectors.jaw`).
"""

HAND = Hand(
    palm=0.006,
    offset=_OFFSET,
    radius=_RADIUS,
    azimuths=(0.0, pi, -pi / 2),
    phalanges=_PHALANGES,
    density=STEEL_DENSITY,
    effort=0.16,
    velocity=_VELOCITY,
    acceleration=_ACCELERATION,
    jerk=jerk_limit(_ACCELERATION),
    modes=MappingProxyType(_MODES),
)
"""Two fingers stand opposed, as the caliper requires, the third one at right angles.

Effort: that of the jaw of a needle driver.
"""
