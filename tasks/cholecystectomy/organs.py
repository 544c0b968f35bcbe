"""Names of the organs and attachments of the operation, as in scenarios with an `anatomy`."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

__all__ = [
    "ARTERY",
    "BILE",
    "BOWEL",
    "COMMON_DUCT",
    "DUCT",
    "FAT",
    "FAT_BEDS",
    "GALLBLADDER",
    "HEPATIC_ARTERY",
    "JOINTS",
    "LIVER",
    "ORGANS",
    "PLATE",
    "SPARED",
    "TARGETS",
    "TUBES",
]

GALLBLADDER, LIVER, FAT, BOWEL = "gallbladder", "liver", "fat", "duodenum"
DUCT, ARTERY = "cystic_duct", "cystic_artery"
COMMON_DUCT, HEPATIC_ARTERY = "common_bile_duct", "hepatic_artery"

TARGETS = (DUCT, ARTERY)
"""Tubes to be clipped and cut; their left ends are at the gallbladder."""
TUBES = (*TARGETS, COMMON_DUCT, HEPATIC_ARTERY)
"""Organs with a middle line."""
SPARED = (COMMON_DUCT, HEPATIC_ARTERY, BOWEL)
"""Organs that must not be hurt."""
ORGANS = (GALLBLADDER, *TUBES, LIVER, FAT, BOWEL)
BILE = (GALLBLADDER, DUCT, COMMON_DUCT)
"""Organs whose openings let out bile."""

PLATE = "cystic_plate"
"""Attachment of the gallbladder to the liver."""
FAT_BEDS = "fat_gallbladder", "fat_cystic_duct", "fat_cystic_artery"
"""Attachments of the fat over the triangle to what lies below; the common duct need not be exposed."""
JOINTS: Mapping[str, str] = MappingProxyType(
    {"neck_duct": DUCT, "duct_confluence": DUCT, "neck_artery": ARTERY, "artery_origin": ARTERY}
)
"""Attachments of the ends of a tube, with the tube."""
