"""Instruments of the PSM: joints, tip frame, end effector, and the masses of their links. SI units, radians.

The numbers of all 54 instruments of the dVRK's controller are in `data/instruments.json`, each with the
source file; right angles are exact there. An instrument is called by name (`LARGE_NEEDLE_DRIVER_400006`) or
by number alone.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from importlib.resources import files
from math import radians
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from robots.dvrk.drive import JAW_COLUMN, disc_shares
from robots.dvrk.end_effectors.clips import CLIPS, Clip
from robots.dvrk.end_effectors.contact_sphere import ContactSphere
from robots.dvrk.end_effectors.electrode import Electrode
from robots.dvrk.end_effectors.end_effector import EndEffector
from robots.dvrk.end_effectors.hand import Hand
from robots.dvrk.end_effectors.jaw import WRIST_ACCELERATION, WRIST_VELOCITY, Jaw
from robots.dvrk.end_effectors.musha import HAND
from robots.dvrk.end_effectors.probe import Probe
from robots.dvrk.end_effectors.rolling_jaw import RollingJaw
from robots.dvrk.end_effectors.scissors import CURVE, Scissors
from robots.dvrk.end_effectors.suction_tube import SuctionTube
from robots.serial_chain import Joint, jerk_limit
from schemas.errors import MotionError, did_you_mean
from schemas.plain_sum import plain_sum
from schemas.vectors import Vector

__all__ = [
    "ROLLING",
    "SHAFT_RADIUS",
    "SUCTION_IRRIGATOR",
    "WRIST_RADIUS",
    "Instrument",
    "instrument",
    "instruments",
]

SHAFT_RADIUS = 0.0084 / 2
"""Radius of the 8 mm instruments (m), as modelled in unina-icaros/dvrk-vrep."""

WRIST_RADIUS = 0.0063 / 2
"""Radius of the link between wrist pitch and wrist yaw (m), same source."""

_JAW_LENGTHS = {
    "006": 0.0102,
    "049": 0.0155,
    "093": 0.0286,
    "172": 0.021,
    "194": 0.0164,
    "205": 0.021,
    "309": 0.0155,
}
"""Length of jaws from the wrist yaw axis (m), by the last digits of the number, the type
(jhu-dvrk/dvrk_model, urdf/common/instruments/tip; the fenestrated bipolar forceps, 205, taken as long as the
Maryland ones, 172).
"""

_OTHER_JAW_LENGTH = _JAW_LENGTHS["049"]
"""Length of jaws without a public model (m): the length of the Cadiere forceps."""

_FOOT = 0.003
"""Length of the bent end of a cautery hook, m; assumed. A spatula's end is straight."""

_PROBE = "palpation-probe"
"""A steel sphere centred on the tip frame in place of the jaws of a large needle driver 400006."""

_MUSHA = "MUSHA_HAND"
"""The MUSHA hand on the shaft of a large needle driver 400006."""

ROLLING = "ROLLING_NEEDLE_DRIVER"
"""A large needle driver 400006 with a rolling jaw."""

SUCTION_IRRIGATOR = "SUCTION_IRRIGATOR"
"""A tube for suction and saline on the shaft and wrist of the cautery spatula 400184.

The dVRK's controller has no suction irrigator.
"""


@dataclass(frozen=True, eq=False)  # arrays have no single truth value, as the equality of Python 3.13 needs
class Instrument:
    """A tool of the arm: joints from the shaft to the wrist, a tip, and an end effector.

    `instrument` returns one object for each name, so instruments are compared by identity.
    """

    name: str
    number: str
    """Intuitive's part number, first six digits; empty for tools not made by Intuitive."""
    joints: tuple[Joint, ...]
    """Roll, wrist pitch, wrist yaw; roll and four wrist joints where the wrist is a snake; roll alone where a
    hand is in place of the wrist.
    """
    tip: Vector
    """Pose of the tip frame in the frame of the last link, shape (4, 4)."""
    end_effector: EndEffector
    actuator_to_joint: Vector
    """Joint positions (roll, wrist pitch, wrist yaw, jaw; with a hand roll and closings of the fingers) of
    disc positions (rad), shape (4, 4).
    """
    source: str
    roll_mass: float = 3.428938e-4
    """Mass of the rolling link, kg (WPI-AIM/dvrk_env, tool_lnd.urdf.xacro: CAD of the large needle driver,
    taken for all).
    """
    pitch_mass: float = 2.491212e-4
    """Mass of the link between wrist pitch and wrist yaw, kg (same file)."""

    @property
    def has_wrist(self) -> bool:
        """Whether there are joints between the shaft's roll and the end effector."""
        return len(self.joints) > 1

    @property
    def has_snake_wrist(self) -> bool:
        """Whether the instrument is a 5 mm tool, with four bending joints instead of wrist pitch and yaw."""
        return len(self.joints) > 3

    @property
    def energy(self) -> Literal["monopolar", "bipolar"] | None:
        """Path of the current of an electrosurgical instrument, by its name.

        From the whole bare tip, or both jaws, to a far plate; or from jaw to jaw.
        """
        if "BIPOLAR" in self.name:
            return "bipolar"
        return "monopolar" if "MONOPOLAR" in self.name or "CAUTERY" in self.name else None

    @property
    def clip(self) -> Clip | None:
        """The clip of a clip applier, by its name."""
        size, _, _ = self.name.partition("_CLIP_APPLIER")
        return CLIPS.get(size) if size != self.name else None

    @property
    def jaw(self) -> Jaw | None:
        """The end effector, if a jaw: only a jaw grasps needles and rings."""
        return self.end_effector if isinstance(self.end_effector, Jaw) else None

    @property
    def jaw_joints(self) -> tuple[Joint, ...]:
        """Joints of the jaw; empty without a jaw."""
        return () if self.jaw is None else self.jaw.joints

    @cached_property
    def spheres(self) -> tuple[ContactSphere, ...]:
        """Contact spheres for tissue; none for a palpation probe, a sphere by itself."""
        return self.end_effector.spheres(self.tip)


def instrument(name: str) -> Instrument:
    """Return the instrument of this name or number.

    Raises MotionError if there is none, with a list of near names.
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
    made[_PROBE] = replace(driver, name=_PROBE, number="", end_effector=Probe())
    spatula = made["PERMANENT_CAUTERY_SPATULA_400184"]
    made[SUCTION_IRRIGATOR] = replace(
        spatula,
        name=SUCTION_IRRIGATOR,
        number="",
        source=f"{spatula.source} (shaft and wrist); robots.dvrk.end_effectors.suction_tube",
        end_effector=SuctionTube(),
    )
    made[_MUSHA] = _with_hand(_MUSHA, HAND, driver)
    source = f"{driver.source}; robots.dvrk.end_effectors.rolling_jaw"
    row = data["instruments"][driver.name]
    rolling = RollingJaw(*_jaw_numbers(driver.number, row, driver.actuator_to_joint))
    made[ROLLING] = replace(driver, name=ROLLING, number="", source=source, end_effector=rolling)
    return MappingProxyType(made)


def _with_hand(name: str, hand: Hand, shaft: Instrument) -> Instrument:
    """Return an instrument with `hand` on the shaft of another instrument.

    The tip is the end of the straight fingers, with the orientation of the other instrument's tip at home.
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
        hand,
        coupling,
        f"{shaft.source} (shaft); robots.dvrk.end_effectors.musha",
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
    coupling = np.array(data["actuator_to_joint"][row["actuator_to_joint"]])
    numbers = _jaw_numbers(number, row, coupling)
    jaw = Jaw(*numbers)
    if "SCISSORS" in name:
        jaw = Scissors(*numbers, curve=CURVE if "CURVED" in name else 0.0)
    electrode = Electrode(foot=_FOOT if "HOOK" in name else 0.0)
    return Instrument(
        name,
        number,
        tuple(_tool_joint(*cells) for cells in row["joints"]),
        np.vstack([data["tips"][row["tip"]], [0.0, 0.0, 0.0, 1.0]]),
        jaw if jaw.effort else electrode,
        coupling,
        row["source"],
    )


def _jaw_numbers(
    number: str, row: dict[str, Any], coupling: Vector
) -> tuple[float, float, float, float, float]:
    """Return the numbers of the jaw in `row`, in the order of the fields of `Jaw`."""
    lower, upper, effort = row["jaw"]
    share = plain_sum(turn**2 for turn in disc_shares(coupling)[:, JAW_COLUMN].tolist())
    return lower, upper, effort, _JAW_LENGTHS.get(number[3:], _OTHER_JAW_LENGTH), share


def _tool_joint(
    name: str, alpha: float, a: float, d: float, theta: float, lower: float, upper: float, effort: float
) -> Joint:
    limits = (WRIST_VELOCITY, effort, WRIST_ACCELERATION, jerk_limit(WRIST_ACCELERATION))
    return Joint(name, "revolute", radians(alpha), a, d, radians(theta), lower, upper, *limits)
