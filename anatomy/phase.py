"""Parts of the operation."""

from typing import Literal

__all__ = ["Phase"]

Phase = Literal["calot-dissection", "clip-and-cut", "gallbladder-bed", "cholecystectomy"]
"""A part of the operation, or the whole."""
