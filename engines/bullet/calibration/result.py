"""Conversion of a calibration to a material file for scenarios."""

from __future__ import annotations

from typing import Any

from engines.bullet.calibration.fit import Calibration
from engines.bullet.calibration.indentation import Indenter
from engines.bullet.calibration.relaxation import Prony
from engines.tissue.organs.material_file import MaterialFile
from engines.tissue.organs.prony import PronyTerm
from schemas.errors import RecordingError

__all__ = ["material_file"]

_LEAST_SHARE = 1e-4
"""Least share of a term: the fit may leave a term without any."""


def material_file(
    found: Calibration, indenter: Indenter, density: float, frequency: float, data: str
) -> MaterialFile:
    """Return the content of the file.

    Bullet's material does not relax, and its damping is proportional to its stiffness. For kind bullet the
    file has the stiffness and the loss of the tissue at `frequency` (Hz), for kind fem the relaxation.

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
            long_term_young_modulus=float(f"{found.young_modulus * found.relaxation.remaining:.5g}"),
            prony=_terms(found.relaxation),
            fit=fit,
        )
    except ValueError as error:
        raise RecordingError(f"no tissue explains '{data}': {error}") from error


def _terms(relaxation: Prony) -> tuple[PronyTerm, ...]:
    """Return the terms that relax at all."""
    return tuple(
        PronyTerm(share=float(f"{share:.5g}"), seconds=float(f"{time:.5g}"))
        for share, time in zip(relaxation.shares, relaxation.times, strict=True)
        if share >= _LEAST_SHARE
    )


def _value(found: Calibration, name: str, value: float) -> dict[str, float]:
    return {"value": float(f"{value:.5g}"), "deviation": float(f"{found.deviations[name]:.2g}")}
