"""Instruments of the PSM: joints, tip frame, jaw or hand, and what their links weigh. SI units, radians.

The numbers of all 54 instruments that the dVRK's controller knows are in `data/instruments.json`, each with
the file they come from; right angles are exact there. An instrument is called by its name
(`LARGE_NEEDLE_DRIVER_400006`) or by its number alone.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib.resources import files
from math import radians
from types import MappingProxyType
from typing import Any

import numpy as np

from robots.dvrk.contact_spheres import ContactSphere, on_jaw
from robots.dvrk.hand import Hand
from robots.dvrk.musha import HAND
from robots.dvrk.rolling_needle_driver import NAME as ROLLING
from robots.dvrk.rolling_needle_driver import Roller, roller
from robots.serial_chain import Joint, jerk_limit
from schemas.errors import MotionError, did_you_mean
from schemas.vectors import Vector

__all__ = ["SHAFT_RADIUS", "STEEL_DENSITY", "WRIST_RADIUS", "Instrument", "Jaw", "instrument", "instruments"]

SHAFT_RADIUS = 0.0084 / 2
"""Of the 8 mm instruments (m), as modelled in unina-icaros/dvrk-vrep."""

WRIST_RADIUS = 0.0063 / 2
"""Of the link between wrist pitch and wrist yaw (m), same source."""

STEEL_DENSITY = 7900.0
"""Stainless steel 1.4301 (AISI 304), kg/m^3 (EN 10088-1, physical properties: 7.9 kg/dm^3)."""

_WRIST_VELOCITY, _WRIST_ACCELERATION = radians(1080.0), radians(720.0)
"""rad/s and rad/s^2, of roll, wrist and jaw (jhu-dvrk/sawIntuitiveResearchKit,
core/components/code/mtsIntuitiveResearchKitPSM.cpp).
"""

_JAW_LENGTHS = {
    "006": 0.0102,
    "049": 0.0155,
    "093": 0.0286,
    "172": 0.021,
    "194": 0.0164,
    "205": 0.021,
    "309": 0.0155,
}
"""From the wrist yaw axis to the end of the jaws (m), by the last digits of the number, which name its type
(jhu-dvrk/dvrk_model, urdf/common/instruments/tip; the fenestrated bipolar forceps, 205, taken as long as the
Maryland ones, 172).
"""

_OTHER_JAW_LENGTH = _JAW_LENGTHS["049"]
"""Of jaws whose length no public model states (m): that of the Cadiere forceps."""

_PROBE = "palpation-probe"
"""A steel sphere centred on the tip frame in place of the jaws of a large needle driver 400006."""

_MUSHA = "MUSHA_HAND"
"""A hand (`robots.dvrk.musha`) on the shaft of a large needle driver 400006."""


@dataclass(frozen=True)
class Jaw:
    """Two fingers about the wrist yaw axis, each turned by half the jaw angle, either way."""

    lower: float
    """Smallest angle, rad; below 0 the fingers press on each other."""
    upper: float
    effort: float
    """Largest torque, N m."""
    length: float
    """From the wrist yaw axis to the end of the fingers, m."""
    velocity: float = _WRIST_VELOCITY
    acceleration: float = _WRIST_ACCELERATION
    jerk: float = jerk_limit(_WRIST_ACCELERATION)

    @property
    def joint(self) -> Joint:
        """The angle as a joint."""
        return Joint(
            "jaw",
            "revolute",
            0.0,
            0.0,
            0.0,
            0.0,
            self.lower,
            self.upper,
            self.velocity,
            self.effort,
            self.acceleration,
            self.jerk,
        )


@dataclass(frozen=True)
class Instrument:
    """What is mounted on the arm: joints from the shaft to the wrist, and a tip."""

    name: str
    number: str
    """Intuitive's part number, first six digits; empty for what Intuitive does not make."""
    joints: tuple[Joint, ...]
    """Roll, wrist pitch, wrist yaw; roll and four wrist joints where the wrist is a snake; roll alone where a
    hand is in place of the wrist.
    """
    tip: Vector
    """Pose of the tip frame in the frame of the last link, shape (4, 4)."""
    jaw: Jaw | None
    """None where there is no jaw: probe, cautery hook and spatula, hand."""
    actuator_to_joint: Vector
    """Joint positions (roll, wrist pitch, wrist yaw, jaw; with a hand roll and the closings of its fingers)
    of disc positions (rad), shape (4, 4).
    """
    source: str
    roll_mass: float = 3.428938e-4
    """Mass of the link that rolls, kg (WPI-AIM/dvrk_env, tool_lnd.urdf.xacro: CAD of the large needle driver,
    taken for all).
    """
    pitch_mass: float = 2.491212e-4
    """Mass of the link between wrist pitch and wrist yaw, kg (same file)."""
    hand: Hand | None = None
    """In place of wrist and jaw."""
    roller: Roller | None = None
    """In the jaw: turns a needle between the fingers."""

    @property
    def has_snake_wrist(self) -> bool:
        """Whether it is a 5 mm instrument, with four bending joints instead of wrist pitch and yaw."""
        return len(self.joints) > 3

    @property
    def jaw_joints(self) -> tuple[Joint, ...]:
        """Joints that are commanded of the jaw: its angle and, with a roller, the needle's.

        They are empty without a jaw.
        """
        return (
            ()
            if self.jaw is None
            else (self.jaw.joint,)
            if self.roller is None
            else (self.jaw.joint, self.roller.joint)
        )

    @cached_property
    def spheres(self) -> tuple[ContactSphere, ...]:
        """What touches tissue; empty without a jaw, and for a palpation probe, which is a sphere itself."""
        if self.hand is not None:
            return self.hand.spheres
        return () if self.jaw is None else on_jaw(self.jaw.length, self.tip[:3, 2])


def instrument(name: str) -> Instrument:
    """Return the instrument of this name or number.

    Raises MotionError if there is none, saying which there are.
    """
    found = instruments().get(name) or _by_number().get(name)
    if found is None:
        raise MotionError(
            f"no instrument '{name}'.{did_you_mean(name, _by_number() if name.isdigit() else instruments())}"
        )
    return found


@cache
def instruments() -> Mapping[str, Instrument]:
    """Return all instruments by name."""
    data = json.loads(files("robots.dvrk").joinpath("data/instruments.json").read_text(encoding="utf-8"))
    made = {name: _from_data(name, row, data) for name, row in data["instruments"].items()}
    driver = made["LARGE_NEEDLE_DRIVER_400006"]
    made[_PROBE] = Instrument(
        _PROBE, "", driver.joints, driver.tip, None, driver.actuator_to_joint, driver.source
    )
    made[_MUSHA] = _with_hand(_MUSHA, HAND, driver)
    source = f"{driver.source}; robots.dvrk.rolling_needle_driver"
    made[ROLLING] = replace(
        driver,
        name=ROLLING,
        number="",
        source=source,
        roller=None if driver.jaw is None else roller(driver.jaw.effort),
    )
    return MappingProxyType(made)


def _with_hand(name: str, hand: Hand, shaft: Instrument) -> Instrument:
    """Return an instrument that has `hand` on the shaft of another one.

    Its tip is the end of the straight fingers, and has at home the orientation of the other one's.
    """
    tip = np.diag([-1.0, -1.0, 1.0, 1.0])
    tip[2, 3] = hand.reach
    # a disc winds up tendon as the first pulley does
    coupling = np.diag([shaft.actuator_to_joint[0, 0], 1.0, 1.0, 1.0])
    return Instrument(
        name,
        "",
        shaft.joints[:1],
        tip,
        None,
        coupling,
        f"{shaft.source} (shaft); robots.dvrk.musha",
        hand=hand,
    )


@cache
def _by_number() -> Mapping[str, Instrument]:
    """Return the instruments by number. A geared variant of the same number goes by its name only."""
    return {
        found.number: found
        for name, found in instruments().items()
        if found.number and name.endswith(found.number)
    }


def _from_data(name: str, row: dict[str, Any], data: dict[str, Any]) -> Instrument:
    number = next(word for word in name.split("_") if word.isdigit() and len(word) == 6)
    lower, upper, effort = row["jaw"]
    jaw = Jaw(lower, upper, effort, _JAW_LENGTHS.get(number[3:], _OTHER_JAW_LENGTH)) if effort else None
    tip = np.vstack([data["tips"][row["tip"]], [0.0, 0.0, 0.0, 1.0]])
    coupling = np.array(data["actuator_to_joint"][row["actuator_to_joint"]])
    return Instrument(
        name, number, tuple(_joint(*cells) for cells in row["joints"]), tip, jaw, coupling, row["source"]
    )


def _joint(
    name: str, alpha: float, a: float, d: float, theta: float, lower: float, upper: float, effort: float
) -> Joint:
    limits = (_WRIST_VELOCITY, effort, _WRIST_ACCELERATION, jerk_limit(_WRIST_ACCELERATION))
    return Joint(name, "revolute", radians(alpha), a, d, radians(theta), lower, upper, *limits)
