"""The organs that a scenario may name."""

from __future__ import annotations

from engines.bullet.organs.colon import COLON
from engines.bullet.organs.kidney import KIDNEY_WITH_ADRENAL
from engines.bullet.organs.liver import LIVER_LOBE

__all__ = ["SHAPES"]

SHAPES = {"kidney-with-adrenal": KIDNEY_WITH_ADRENAL, "colon": COLON, "liver-lobe": LIVER_LOBE}
