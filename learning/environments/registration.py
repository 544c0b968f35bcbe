"""The environments by name, and their registration with Gymnasium."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from learning.environments.environment import Environment

__all__ = ["ENVIRONMENTS", "make", "register"]

ENVIRONMENTS: Mapping[str, tuple[str, int]] = MappingProxyType(
    {
        "trocar/Reach-v0": ("Reach", 50),
        "trocar/NeedlePick-v0": ("NeedlePick", 50),
        "trocar/NeedleHandOver-v0": ("NeedleHandOver", 100),
        "trocar/PegTransfer-v0": ("PegTransfer", 50),
        "trocar/BiPegTransfer-v0": ("TwoHandedPegTransfer", 150),
        "trocar/PickAndPlace-v0": ("PickAndPlace", 50),
        "trocar/Retraction-v0": ("Retraction", 50),
        "trocar/Dissect-v0": ("Dissect", 150),
        "trocar/TissueCut-v0": ("TissueCut", 100),
    }
)
"""Class of the exercise and steps of an episode, by id."""


def make(exercise: str, **arguments: Any) -> Environment:
    """Return the environment of an exercise; Gymnasium calls this."""
    from learning.environments import exercises
    from learning.environments.environment import Environment

    return Environment(getattr(exercises, exercise), **arguments)


def register() -> None:
    """Register all environments. Raises MissingExtraError without Gymnasium."""
    try:
        import gymnasium
    except ModuleNotFoundError as error:
        from schemas.errors import MissingExtraError

        raise MissingExtraError("trocar.environments", "gym", "gymnasium") from error
    registry: Any = gymnasium
    for name, (exercise, steps) in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            registry.register(
                name,
                entry_point="learning.environments.registration:make",
                vector_entry_point="learning.environments.vector:make_vector",
                max_episode_steps=steps,
                kwargs={"exercise": exercise},
            )
