"""Bodies of a scene with their numbers, classes and instances."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from engines.mujoco.object_params import NeedleParams
from engines.mujoco.params import SceneParams
from engines.mujoco.truth.scene_class import INSTRUMENT_CLASSES, SceneClass
from robots.dvrk.mounted.mounted_psm import MountedPsm

__all__ = ["Body", "label_bodies", "rigid_class"]


@dataclass(frozen=True)
class Body:
    """A body that pictures may show."""

    id: int
    """Number in the picture of bodies; 0 is the background."""
    name: str
    """Name in the scene: `PSM1/roll`, `needle`, `liver`."""
    scene_class: SceneClass
    instance: int
    """Number of the instance; an instrument of several bodies is one."""
    instance_name: str

    def as_json(self) -> dict[str, Any]:
        """Return the fields, the class by name."""
        return {
            "id": self.id,
            "name": self.name,
            "class": self.scene_class.name.lower(),
            "instance": self.instance,
            "instance_name": self.instance_name,
        }


def label_bodies(named: Iterable[tuple[str, SceneClass]]) -> tuple[Body, ...]:
    """Return bodies, numbered from 1, for names and classes; all parts of an instrument are one instance."""
    instances: dict[str, int] = {}
    found: list[Body] = []
    for number, (name, scene_class) in enumerate(named, 1):
        instance = name.partition("/")[0] if scene_class in INSTRUMENT_CLASSES else name
        if scene_class is SceneClass.ARM:
            instance = f"{name.partition('/')[0]}/arm"
        found.append(
            Body(number, name, scene_class, instances.setdefault(instance, len(instances) + 1), instance)
        )
    return tuple(found)


def rigid_class(params: SceneParams, body: str) -> SceneClass:
    """Return the class of a body of the scene's model by its name."""
    owner, _, link = body.partition("/")
    if owner == "table":
        return SceneClass.TABLE
    if owner in params.fixtures:
        return SceneClass.FIXTURE
    if owner in params.objects:
        is_needle = isinstance(params.objects[owner], NeedleParams)
        return SceneClass.NEEDLE if is_needle else SceneClass.OBJECT
    arm = next((mounted for name, mounted in params.arms.items() if name == owner), None)
    if isinstance(arm, MountedPsm):
        spare, _, part = link.rpartition("/")
        held = arm.by_owner(owner)[f"{owner}/{spare}" if spare else owner]
        return _instrument_class(held, part)
    return SceneClass.ARM


def _instrument_class(arm: MountedPsm, link: str) -> SceneClass:
    if link in {end.name for end in arm.end_effector_links}:
        return SceneClass.JAW
    wrist = [joint.name for joint in arm.tool.joints]
    if link not in wrist:
        return SceneClass.ARM
    if link == wrist[0]:
        return SceneClass.SHAFT
    # a hook, a blade or a sphere is fixed to the last link
    is_tool = link == wrist[-1] and not arm.end_effector_links
    return SceneClass.JAW if is_tool else SceneClass.WRIST
