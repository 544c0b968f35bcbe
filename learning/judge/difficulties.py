"""Difficulties: how the world of an episode differs from the world in which policies are trained.

Each difficulty is a function of an episode's seed, so that the same seed means the same world for every
policy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from schemas.errors import ScenarioError, did_you_mean

__all__ = ["DIFFICULTIES", "Difficulty", "difficulties_of"]

_JOINTS = ("2.5 deg", "2.5 deg", "2 mm")
"""Bounds of drawn offsets of yaw, pitch and insertion: 5 mm (root mean square) at a tip 140 mm deep, as the
error of a dVRK's kinematics before correction in arXiv 2406.07375 (5.0 mm).
"""


class Difficulty(NamedTuple):
    """Changes of an environment."""

    description: str
    settings: Callable[[int], Mapping[str, Any]] = lambda _seed: {}
    """Values of the scenario for an episode's seed."""
    delay: float = 0.0
    """Age of observations, s."""


def _joint_errors(seed: int) -> Mapping[str, Any]:
    return {"participants.actions.joint_errors": {"within": list(_JOINTS), "seed": seed}}


def _camera_offset(seed: int) -> Mapping[str, Any]:
    """Return a camera that stands and looks elsewhere, and else shows the same."""
    same = {
        "textures": False,
        "colour": 0.0,
        "light": 0.0,
        "exposure": 0.0,
        "smoke": 0.0,
        "background": False,
    }
    return {"participants.camera.randomise": {"seed": seed, "offset": "5 mm", "turn": "3 deg", **same}}


def _looks(seed: int) -> Mapping[str, Any]:
    return {"participants.camera.looks": "endoscope", "participants.camera.randomise": {"seed": seed}}


DIFFICULTIES: Mapping[str, Difficulty] = MappingProxyType(
    {
        "nominal": Difficulty("as in training"),
        "joint-errors": Difficulty("encoders with offsets, as on a real arm: 5 mm at the tip", _joint_errors),
        "camera-offset": Difficulty("a camera up to 5 mm and 3 degrees off, on each axis", _camera_offset),
        "looks": Difficulty("endoscope looks that differ from trial to trial", _looks),
        "latency-100": Difficulty("observations 100 ms old", delay=0.1),
        "latency-200": Difficulty("observations 200 ms old", delay=0.2),
        "latency-300": Difficulty("observations 300 ms old", delay=0.3),
    }
)
"""Difficulties by name."""


def difficulties_of(text: str) -> tuple[str, ...]:
    """Return the difficulties named in a list with commas; `all` is all. Raises ScenarioError."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    if names == ("all",):
        return tuple(DIFFICULTIES)
    if unknown := [name for name in names if name not in DIFFICULTIES]:
        raise ScenarioError(
            f"no difficulty '{unknown[0]}'.{did_you_mean(unknown[0], DIFFICULTIES)} Allowed: all, or some of"
            f" {', '.join(DIFFICULTIES)}"
        )
    return names
