"""Conversion of a calibration to a material file for scenarios."""

from __future__ import annotations

from typing import Any

from engines.bullet.calibration.fit import Calibration
from engines.bullet.calibration.indentation import Indenter
from engines.tissue.organs.material_file import MaterialFile
from schemas.errors import RecordingError

__all__ = ["material_file"]


def material_file(
    found: Calibration, indenter: Indenter, density: float, frequency: float, data: str
) -> MaterialFile:
    """Return the content of the file.

    Bullet's material does not relax, and its damping is proportional to its stiffness. The file has the
    stiffness and the loss of the tissue at `frequency` (Hz).

    Args:
        found: the calibration.
        indenter: the indenter.
        density: kg/m^3.
        frequency: frequency of the simulated motions, Hz.
        data: name of the file of measurements.

    Raises RecordingError for a material unlike tissue.
    """
    storage, damping = found.relaxation.at(frequency)
    quick, slow = (
        {"share": _value(found, f"share_{i}", share), "time": _value(found, f"time_{i}", time)}
        for i, (share, time) in enumerate(
            zip(found.relaxation.shares, found.relaxation.times, strict=True), 1
        )
    )
    fit: dict[str, Any] = {
        "data": data,
        "shape": indenter.shape,
        "radius": indenter.radius,
        "thickness": indenter.thickness,
        "frequency": frequency,
        "instantaneous_young_modulus": _value(found, "young_modulus", found.young_modulus),
        "surface": _value(found, "surface", found.surface),
        "relaxation": [quick, slow],
        "relative_residual": round(found.residual, 5),
    }
    if found.stiffening is not None:
        fit["stiffening"] = _value(found, "stiffening", found.stiffening)
    if found.friction is not None:
        fit["friction"] = _value(found, "friction", found.friction)
    try:
        return MaterialFile(
            young_modulus=float(f"{found.young_modulus * storage:.5g}"),
            poisson_ratio=indenter.poisson_ratio,
            density=density,
            damping=float(f"{damping:.4g}"),
            friction=None if found.friction is None else float(f"{found.friction:.4g}"),
            fit=fit,
        )
    except ValueError as error:
        raise RecordingError(f"no tissue explains '{data}': {error}") from error


def _value(found: Calibration, name: str, value: float) -> dict[str, float]:
    return {"value": float(f"{value:.5g}"), "deviation": float(f"{found.deviations[name]:.2g}")}
