"""Names of instruments in the words of the dVRK (SAW = jhu-dvrk/sawIntuitiveResearchKit)."""

from __future__ import annotations

from robots.dvrk.instruments import Instrument

__all__ = ["tool_type"]

_GEARED = "_GEARED"
_VERSIONS = {"420006": ("..11", "12.."), "420093": ("..13", "14..")}
"""Both ranges of versions of instruments with geared later versions (SAW share/tool/index.json)."""


def tool_type(instrument: Instrument) -> str:
    """Return `NAME:NUMBER[VERSIONS]`, such as `LARGE_NEEDLE_DRIVER:400006[..]` (SAW mtsToolList.cpp, Name).

    An instrument without a number has the name alone.
    """
    if not instrument.number:
        return instrument.name
    name, geared = instrument.name.removesuffix(_GEARED), instrument.name.endswith(_GEARED)
    versions = _VERSIONS.get(instrument.number)
    if versions is None:
        return (
            f"{name.removesuffix(f'_{instrument.number}')}:{instrument.number}[..]{_GEARED if geared else ''}"
        )
    return f"{name.removesuffix(f'_{instrument.number}')}:{instrument.number}[{versions[geared]}]"
