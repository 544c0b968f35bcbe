"""Classes of what a picture shows, with numbers that stay the same in all scenes."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

from schemas.soft_surface import FaceKind

__all__ = ["INSTRUMENT_CLASSES", "LIQUIDS", "SURFACES", "SceneClass", "tissue_class"]


class SceneClass(IntEnum):
    """Class of a pixel. Numbers are never given to another class later."""

    BACKGROUND = 0
    SHAFT = 1
    """Shaft of an instrument, with its clevis."""
    WRIST = 2
    """Links between shaft and fingers."""
    JAW = 3
    """Fingers, blades, hooks, probes: the end effector."""
    ARM = 4
    """Robot outside the instruments: links, housings, endoscope, cart."""
    NEEDLE = 5
    THREAD = 6
    OBJECT = 7
    """Movable object of a training scene."""
    FIXTURE = 8
    TABLE = 9
    SURROUNDINGS = 10
    TISSUE = 20
    """Tissue without a name."""
    ADRENAL = 21
    BOWEL = 22
    COLON = 23
    FAT = 24
    GALLBLADDER = 25
    KIDNEY = 26
    LIVER = 27
    MUSCLE = 28
    PERITONEUM = 29
    SKIN = 30
    CUT = 40
    """Inside of tissue that a cut has opened."""
    COAGULATED = 41
    CHARRED = 42
    BLOOD = 43
    BILE = 44


INSTRUMENT_CLASSES = (SceneClass.SHAFT, SceneClass.WRIST, SceneClass.JAW)

SURFACES: Mapping[FaceKind, SceneClass] = {
    FaceKind.CUT: SceneClass.CUT,
    FaceKind.COAGULATED: SceneClass.COAGULATED,
    FaceKind.CHARRED: SceneClass.CHARRED,
}
"""Classes of changed surfaces; the outside has the class of its tissue."""

LIQUIDS: Mapping[str, SceneClass] = {"blood": SceneClass.BLOOD, "bile": SceneClass.BILE}


def tissue_class(tissue: str) -> SceneClass:
    """Return the class of a tissue of `SkinParams`, or of a thread."""
    return SceneClass[tissue.upper()]
