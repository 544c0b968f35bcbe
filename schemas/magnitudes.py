"""Least and greatest sizes of physical parameters: beyond, a simulation gives numbers without a meaning.

A gravity of 1e200 m/s^2 ended as `done`, with tissue that stood still, and was the same again in `verify`.
The limits are some powers of ten beyond every robot, tool and tissue: no sensible scene meets a limit.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["ABSURD", "MAGNITUDES", "Magnitude", "require_magnitude"]

ABSURD = 1e9
"""Size in SI units above which a force, a pose or a joint position of a session has no meaning."""


class Magnitude(NamedTuple):
    """The allowed sizes of a quantity, apart from zero, and examples at both ends."""

    least: float
    most: float
    reason: str


MAGNITUDES = {
    "m": Magnitude(0.0, 1e3, "to a building"),
    "kg": Magnitude(1e-6, 1e4, "from a piece of suture to a lorry"),
    "Pa": Magnitude(1e-3, 1e13, "from a foam to ten times diamond"),
    "kg/m^3": Magnitude(1e-3, 1e5, "from a gas to four times osmium"),
    "J/m^2": Magnitude(1e-3, 1e7, "from a gel to a hundred times steel"),
    "m^3": Magnitude(1e-15, 1e6, "from a cell to a reservoir"),
    "m^3/s": Magnitude(1e-15, 1e3, "from a sweat gland to a river"),
    "m^3/(s kg)": Magnitude(1e-12, 1e3, "from a cartilage to a pump"),
    "N": Magnitude(1e-9, 1e6, "from a cell to a hundred tonnes"),
    "W": Magnitude(1e-9, 1e6, "from a cell to a locomotive"),
    "N/m": Magnitude(1e-6, 1e9, "from a cell to a machine's frame"),
    "N*s/m": Magnitude(1e-9, 1e7, "from a cell to a vehicle's damper"),
    "rad": Magnitude(0.0, 1e5, "to 16 000 turns"),
    "m/s": Magnitude(0.0, 1e4, "to ten times a bullet"),
    "m/s^2": Magnitude(0.0, 1e3, "to a hundred times standard gravity"),
}
"""Limits by SI unit. Components of positions, angles and motions may be as small as rounding leaves them."""


def require_magnitude(number: float, unit: str) -> float:
    """Return `number`; raises ValueError if a quantity in `unit` has no such size."""
    size, limits = abs(number), MAGNITUDES[unit]
    if size and not limits.least <= size <= limits.most:
        expected = f"0, or {limits.least:g} to {limits.most:g}" if limits.least else f"0 to {limits.most:g}"
        raise ValueError(
            f"{number:g} {unit} has no meaning here: expected {expected} {unit} ({limits.reason})"
        )
    return number
