"""The MUSHA hand: three under-actuated fingers of three phalanges on the shaft of a PSM, in place of wrist and jaw.

Published are three fingers of three phalanges, under-actuation, the modes retractor, grasp and caliper (palpation), and that the hand folds into a cylinder of
12 mm (Liu et al., "The MUSHA Hand II", IEEE/ASME Transactions on Mechatronics; Selvaggio et al., International Journal of Medical
Robotics 2019, DOI 10.1002/rcs.1981). Lengths, ranges, pulleys and springs are not: those here are ours, see docs/decisions/0018.
SI units, radians.
"""

from __future__ import annotations

from math import pi, radians
from types import MappingProxyType

from robots.dvrk.hand import Hand, Mode, Phalanx
from robots.dvrk.limits import jerk

__all__ = ["HAND", "TROCAR_RADIUS"]

TROCAR_RADIUS = 0.012 / 2
"""Of the cylinder into which the hand folds (Liu et al.)."""

_RADIUS = 0.0024
"""Of a phalanx: three of them, two opposed and one at right angles, fit into the trocar up to offset (1 + 1 / sqrt 2)."""
_OFFSET = 0.0035
"""From the shaft's axis to a finger's: sqrt 2 times this keeps neighbours apart, this plus the radius is under that of the trocar."""

_PHALANGES = (
    Phalanx("proximal", 0.018, radians(-85.0), radians(45.0), 0.0020, 5e-3, radians(-105.0), contact=0.5),
    Phalanx("middle", 0.014, 0.0, radians(90.0), 0.0016, 6e-3, radians(-120.0), contact=0.5),
    Phalanx("distal", 0.012, 0.0, radians(75.0), 0.0012, 5e-3, radians(-110.0), contact=1.0),
)
"""The springs of middle and distal joint are preloaded so that an unloaded finger turns as one piece as far as its first joint goes."""

_OUT = radians(-85.0)
"""A finger at right angles to the shaft, all but 5 degrees."""

_MODES = {
    "folded": Mode((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "retractor": Mode((_OUT, _OUT, _OUT), (0.0, 0.0, 0.0)),
    "grasp": Mode((radians(-60.0), radians(-60.0), radians(-60.0)), (radians(60.0), radians(60.0), radians(60.0))),
    "caliper": Mode((radians(-70.0), radians(-70.0), _OUT), (0.0, 0.0, _OUT)),
}
"""folded: through the trocar. retractor: all fingers fan out, over half a turn. grasp: all close on what lies between them. caliper: the two
opposed fingers close on what is measured, the third one is out of the way."""

_VELOCITY, _ACCELERATION = radians(180.0), radians(720.0)
"""Of a closing: the range of a finger in a second; the acceleration is that of wrist and jaw (`robots.dvrk.instruments`)."""

HAND = Hand(
    palm=0.006,
    offset=_OFFSET,
    radius=_RADIUS,
    azimuths=(0.0, pi, -pi / 2),
    phalanges=_PHALANGES,
    density=7900.0,
    effort=0.16,
    velocity=_VELOCITY,
    acceleration=_ACCELERATION,
    jerk=jerk(_ACCELERATION),
    modes=MappingProxyType(_MODES),
)
"""Four discs turn a PSM's instrument (`robots.dvrk.drives`): one rolls it, so three are left, one for each finger and none to spread them. Two
fingers stand opposed, as the caliper wants it, the third one at right angles. Effort: that of the jaw of a needle driver, whose motors
they have. Density: of steel 1.4301, as of the palpation probe."""
