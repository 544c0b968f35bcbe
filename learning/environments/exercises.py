"""The exercises of the environments: scene, starting places, and drawn goals.

Metres, in the world of the scene; quaternions (x, y, z, w). Numbers of SurRoL are from med-air/SurRoL at
a903fa6, in its unscaled lengths.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from math import pi
from typing import Any, ClassVar

import numpy as np
from numpy.random import Generator

from learning.environments.goals import Tolerance
from learning.environments.view import EnvironmentView
from robots import rotation
from robots.training.dishes import DISH, PIECE
from schemas.vectors import Vector
from tasks.peg_board import PegBoardTask
from tasks.pick_and_place import PickAndPlaceTask
from tasks.task import Task

__all__ = [
    "Dissect",
    "Exercise",
    "NeedleHandOver",
    "NeedlePick",
    "PegTransfer",
    "PickAndPlace",
    "Reach",
    "Retraction",
    "TissueCut",
    "TwoHandedPegTransfer",
]

Starts = Mapping[str, Vector]
"""Where things are put at reset: poses, shape (7,), by name."""
_NEAR = Tolerance(5e-3)
"""SurRoL's: 5 mm."""
_DEAD = 1e-7
"""Dead volume of a bed that costs 1 in the shaped reward, m^3."""


class Exercise(ABC):
    """An environment's task."""

    scene: ClassVar[str]
    hands: ClassVar[tuple[str, ...]] = ("PSM1",)
    goal_size: ClassVar[int] = 3
    tolerance: ClassVar[Tolerance] = _NEAR
    floor: ClassVar[float] = -0.05
    """Height below which an object is lost, m."""
    puts: ClassVar[bool] = True
    """Whether things are put where an episode starts."""

    def __init__(self, task: Task) -> None:
        """Begin with the task that watches the scene and knows the objects' targets."""
        self.task = task

    @abstractmethod
    def draw(self, rng: Generator) -> tuple[Starts, Vector]:
        """Return where things start and the goal, shape (goal_size,), of an episode."""

    @abstractmethod
    def achieved_goal(self, view: EnvironmentView) -> Vector:
        """Return the achieved part of the goal, shape (goal_size,)."""

    def harm(self, view: EnvironmentView) -> float:  # noqa: ARG002
        """Return the harm done so far, in units of the shaped reward."""
        return 0.0

    def has_lost_object(self, view: EnvironmentView) -> bool:
        """Return whether a thing has fallen out of the scene."""
        return bool((view.poses[:, 2] < self.floor).any())


class Reach(Exercise):
    """Bring the tip to a point. SurRoL's PsmReach."""

    scene = "reach"
    puts = False

    def draw(self, rng: Generator) -> tuple[Starts, Vector]:
        """Draw a point of the workspace: 80 x 80 x 50 mm."""
        return {}, rng.uniform([-0.04, -0.04, 0.015], [0.04, 0.04, 0.065])

    def achieved_goal(self, view: EnvironmentView) -> Vector:
        """Return where the tip is."""
        return view.tips[0, :3]


_RADIUS, _WIRE = 11.44e-3, 0.4e-3
"""Radius and wire of the needle (engines.mujoco.object_params), m."""
_SPREAD = 10e-3
"""SurRoL's: where a needle starts, to either side, and the standard deviation of a goal, m."""


def _needle_at(x: float, y: float, yaw: float) -> Vector:
    """Return the pose of a needle on the table with its middle at (x, y) and its x axis at `yaw` (rad)."""
    turn = rotation.exp(np.array([0.0, 0.0, yaw]))
    centre = np.array([x, y, _WIRE]) - _RADIUS * np.array([np.cos(yaw), np.sin(yaw), 0.0])
    return np.concatenate([centre, turn])


def _middle(pose: Vector) -> Vector:
    """Return the middle of a needle's arc, m."""
    return pose[:3] + rotation.matrix(pose[3:])[:, 0] * _RADIUS


class NeedlePick(Exercise):
    """Take up a needle by the middle and bring the middle to a goal over the table. SurRoL's NeedlePick."""

    scene = "needle-pick"

    def draw(self, rng: Generator) -> tuple[Starts, Vector]:
        """Draw the needle within 10 mm and half a turn, and a goal 40 mm high."""
        x, y = rng.uniform(-_SPREAD, _SPREAD, 2)
        yaw = pi + rng.uniform(-pi / 2.0, pi / 2.0)
        gx, gy = np.clip(rng.normal(0.0, _SPREAD, 2), -0.035, 0.035)
        return {"needle": _needle_at(x, y, yaw)}, np.array([gx, gy, 0.04])

    def achieved_goal(self, view: EnvironmentView) -> Vector:
        """Return where the middle of the needle is."""
        return _middle(view.poses[0])


class NeedleHandOver(Exercise):
    """Take up a needle with PSM1, hand over to PSM2, and bring the needle to a goal on PSM2's side."""

    scene = "needle-hand-over"
    hands = ("PSM1", "PSM2")
    goal_size = 4
    tolerance = Tolerance(10e-3)

    def draw(self, rng: Generator) -> tuple[Starts, Vector]:
        """Draw the needle within 5 mm and 30 degrees, and a goal of PSM2's, 40 mm high."""
        x, y = rng.uniform(-0.5 * _SPREAD, 0.5 * _SPREAD, 2)
        yaw = pi + rng.uniform(-pi / 6.0, pi / 6.0)
        gx, gy = rng.uniform([0.02, -0.015], [0.04, 0.015])
        return {"needle": _needle_at(x, y, yaw)}, np.array([gx, gy, 0.04, 1.0])

    def achieved_goal(self, view: EnvironmentView) -> Vector:
        """Return the middle of the needle, and whether PSM2 holds the needle."""
        return np.append(_middle(view.poses[0]), view.held[0, 1])


class PegTransfer(Exercise):
    """Carry a ring from a post to a given post of the opposite side. SurRoL's PegTransfer."""

    scene = "peg-transfer"
    tolerance = Tolerance(5e-3, 4e-3)
    floor = -0.06
    task: PegBoardTask

    def draw(self, rng: Generator) -> tuple[Starts, Vector]:
        """Draw the ring's post, its turn, and the target post."""
        goals = self.task.goals
        assert goals.positions is not None
        start, target = rng.choice(self.starts), rng.choice(sorted(goals.targets[0]))
        turn = rotation.exp(np.array([0.0, 0.0, rng.uniform(-pi / 3.0, pi / 3.0)]))
        return {"ring": np.concatenate([goals.positions[start], turn])}, goals.positions[target].copy()

    @property
    def starts(self) -> tuple[int, ...]:
        """The starting posts of rings."""
        return self.task.params.board.measures.starts

    def achieved_goal(self, view: EnvironmentView) -> Vector:
        """Return where the ring's middle is."""
        return view.poses[0, :3]


class TwoHandedPegTransfer(PegTransfer):
    """Carry a ring over the wall of the board of ICRA 2026, from hand to hand."""

    scene = "bi-peg-transfer"
    hands = ("PSM1", "PSM2")
    floor = 0.7


class PickAndPlace(Exercise):
    """Carry a piece from the table into a dish of two."""

    scene = "pick-and-place"
    tolerance = Tolerance(DISH.inner_radius, 0.5 * DISH.height)
    floor = -0.02
    task: PickAndPlaceTask

    def draw(self, rng: Generator) -> tuple[Starts, Vector]:
        """Draw the piece's place, turn, and dish."""
        x, y = rng.uniform([-0.01, -0.035], [0.01, -0.015])
        height = PIECE.size[2] / 2.0
        turn = rotation.exp(np.array([0.0, 0.0, rng.uniform(-pi / 4.0, pi / 4.0)]))
        dishes: Mapping[str, Any] = self.task.params.fixtures
        dish = np.array(dishes[str(rng.choice(sorted(dishes)))].position)
        return {"piece": np.concatenate([[x, y, height], turn])}, dish + np.array([0.0, 0.0, height])

    def achieved_goal(self, view: EnvironmentView) -> Vector:
        """Return where the piece's middle is."""
        return view.poses[0, :3]


class Retraction(Exercise):
    """Grasp the free edge of the liver's left lobe and lift the edge to a height."""

    scene = "retraction"
    goal_size = 1
    puts = False
    tolerance = Tolerance(4e-3)

    def draw(self, rng: Generator) -> tuple[Starts, Vector]:
        """Draw how far the edge is to be lifted: 12 to 25 mm."""
        return {}, rng.uniform(0.012, 0.025, 1)

    def achieved_goal(self, view: EnvironmentView) -> Vector:
        """Return the lifted height of the held tissue, 0 while nothing is held."""
        return np.array([view.tissue["tissue/lift"] * view.tissue["tissue/held"]])


class Dissect(Exercise):
    """Burn a sheet of fat off its bed of liver with the hook of PSM1; PSM2 holds the sheet.

    Power below the sheet frees the sheet, and kills cells of the bed when too near or too long.
    """

    scene = "dissect"
    hands = ("PSM1", "PSM2")
    goal_size = 1
    puts = False
    tolerance = Tolerance(0.5e-3)

    def draw(self, rng: Generator) -> tuple[Starts, Vector]:
        """Draw the length over which the sheet is to be freed: 2.5 to 5 mm."""
        return {}, rng.uniform(2.5e-3, 5e-3, 1)

    def achieved_goal(self, view: EnvironmentView) -> Vector:
        """Return the freed length."""
        return np.array([view.tissue["tissue/freed"]])

    def harm(self, view: EnvironmentView) -> float:
        """Return the dead volume of the bed, in units of 100 mm^3."""
        return view.tissue["tissue/dead"] / _DEAD


class TissueCut(Exercise):
    """Take the free end of a strip of tissue with PSM2, and cut off a given length with PSM1's scissors."""

    scene = "tissue-cut"
    hands = ("PSM1", "PSM2")
    goal_size = 1
    puts = False
    tolerance = Tolerance(3e-3)
    length: ClassVar[float] = 28e-3
    """Length of the strip, m."""

    def draw(self, rng: Generator) -> tuple[Starts, Vector]:
        """Draw the length to be cut off: 12 to 18 mm."""
        return {}, rng.uniform(0.012, 0.018, 1)

    def achieved_goal(self, view: EnvironmentView) -> Vector:
        """Return the length of the tissue that has been cut off, m."""
        return np.array([view.tissue["tissue/loose"] * self.length])
