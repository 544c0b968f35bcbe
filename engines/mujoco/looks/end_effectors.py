"""Looks and collision shapes of end effectors by kind; a new kind is registered here.

Both are drawn in the PSM's base frame with every joint at 0. A kind not registered is not drawn and collides
with nothing, contact spheres apart.
"""

from __future__ import annotations

from functools import singledispatch

from engines.mujoco.looks import electrode, fingers, musha, own_jaw, rolling_jaw, suction_tube
from engines.mujoco.looks.part import Collisions, Looks
from robots.dvrk.end_effectors.electrode import Electrode
from robots.dvrk.end_effectors.end_effector import EndEffector, Mount
from robots.dvrk.end_effectors.hand import Hand
from robots.dvrk.end_effectors.jaw import Jaw
from robots.dvrk.end_effectors.own_jaw import OwnJaw
from robots.dvrk.end_effectors.rolling_jaw import RollingJaw
from robots.dvrk.end_effectors.suction_tube import SuctionTube

__all__ = ["collision", "parts"]


@singledispatch
def parts(_effector: EndEffector, _instrument: str, _mount: Mount) -> Looks:
    """Return the meshes by body of an end effector, of the instrument of this name."""
    return {}


@singledispatch
def collision(_effector: EndEffector, _instrument: str, _mount: Mount) -> Collisions:
    """Return the collision shapes by body of an end effector, of the instrument of this name."""
    return {}


parts.register(Jaw, fingers.parts)
parts.register(OwnJaw, own_jaw.parts)
parts.register(RollingJaw, rolling_jaw.parts)
parts.register(Hand, musha.parts)
parts.register(Electrode, electrode.parts)
parts.register(SuctionTube, suction_tube.parts)
collision.register(Jaw, fingers.collision)
collision.register(OwnJaw, own_jaw.collision)
collision.register(RollingJaw, rolling_jaw.collision)
collision.register(Hand, musha.collision)
