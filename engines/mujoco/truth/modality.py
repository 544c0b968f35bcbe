"""Names of the modalities of truth."""

from __future__ import annotations

from typing import Literal, get_args

__all__ = ["MODALITIES", "Modality", "parse_modalities"]

Modality = Literal["depth", "segmentation", "normals", "flow", "keypoints"]

MODALITIES: tuple[Modality, ...] = get_args(Modality)


def parse_modalities(text: str) -> frozenset[Modality]:
    """Return the modalities named in `text`, separated by commas. Raises ValueError for others."""
    asked = {name.strip() for name in text.split(",") if name.strip()}
    found: frozenset[Modality] = frozenset(name for name in MODALITIES if name in asked)
    if others := sorted(asked - found) or ([] if found else [text]):
        raise ValueError(
            f"'{', '.join(others)}': expected some of {', '.join(MODALITIES)}, with commas between"
        )
    return found
