"""What an arm holds, in the words of the dVRK (SAW = jhu-dvrk/sawIntuitiveResearchKit)."""

from __future__ import annotations

from robots.dvrk.ecm import Endoscope
from robots.dvrk.instruments import Instrument

__all__ = ["endoscope_type", "tool_type"]

_GEARED = "_GEARED"
_VERSIONS = {"420006": ("..11", "12.."), "420093": ("..13", "14..")}
"""Of the instruments whose later versions are geared, both ranges (SAW share/tool/index.json)."""


def tool_type(instrument: Instrument) -> str:
    """Return `NAME:NUMBER[VERSIONS]` (SAW mtsToolList.cpp, Name), such as `LARGE_NEEDLE_DRIVER:400006[..]`; the name alone of what has no number."""
    if not instrument.number:
        return instrument.name
    name, geared = instrument.name.removesuffix(_GEARED), instrument.name.endswith(_GEARED)
    versions = _VERSIONS.get(instrument.number)
    if versions is None:
        return f"{name.removesuffix(f'_{instrument.number}')}:{instrument.number}[..]{_GEARED if geared else ''}"
    return f"{name.removesuffix(f'_{instrument.number}')}:{instrument.number}[{versions[geared]}]"


def endoscope_type(endoscope: Endoscope) -> str:
    """Return the name of an endoscope of the Classic with its SD camera, the one whose mass the model has (SAW mtsIntuitiveResearchKitEndoscopeTypes.cdg)."""
    return f"Classic_SD_{endoscope.upper()}"
