"""Conversion of a fit to a file of dynamics for scenarios."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robots.dvrk.own_dynamics import BodyInertia, DiscLosses, JointLosses, OwnDynamics
from robots.identification.fit import Fit
from robots.identification.linear_model import LinearModel, pseudo_inertias
from schemas.vectors import Vector

__all__ = ["own_dynamics"]


def own_dynamics(found: Fit, cutoff: float, recordings: Sequence[str]) -> OwnDynamics:
    """Return the content of the file: the parameters of `found` and their provenance."""
    model = found.model
    values = {name: found.parameters[part].tolist() for name, part in model.parts.items()}
    bodies = pseudo_inertias(found.parameters[model.parts["body"]])
    friction = _friction(model, values)
    return OwnDynamics(
        instrument=model.arm.tool,
        bodies={name: _body(pseudo) for name, pseudo in zip(model.arm.bodies, bodies, strict=True)},
        joints={
            joint: JointLosses(
                armature=armature,
                stiffness=stiffness,
                offset=offset,
                **friction.get(joint, DiscLosses()).model_dump(),
            )
            for joint, armature, stiffness, offset in zip(
                model.joints, values["armature"], values["stiffness"], values["offset"], strict=True
            )
        },
        discs=[losses for name, losses in friction.items() if name.startswith("disc_")],
        fingers=[losses for name, losses in friction.items() if name.startswith("finger_")],
        fit=_fit_provenance(found, cutoff, recordings),
    )


def _friction(model: LinearModel, values: Mapping[str, list[float]]) -> dict[str, DiscLosses]:
    """Return the friction of each rubbing pair, by name."""
    static = values.get("static", [0.0] * len(model.rubbing))
    velocities = (
        [None] * len(model.rubbing) if model.shape.stribeck is None else model.shape.stribeck.tolist()
    )
    columns = (values["viscous"], values["coulomb"], model.shape.smoothing.tolist(), static, velocities)
    names = ("viscous", "coulomb", "smoothing", "static", "stribeck")
    return {
        name: DiscLosses.model_validate(dict(zip(names, row, strict=True)))
        for name, *row in zip(model.rubbing, *columns, strict=True)
    }


def _fit_provenance(found: Fit, cutoff: float, recordings: Sequence[str]) -> dict[str, Any]:
    model = found.model
    return {
        "recordings": list(recordings),
        "cutoff_hz": cutoff,
        "samples": len(found.time),
        "condition_number": float(f"{found.condition:.3g}"),
        "relative_residual": _round_values(model.joints, found.residual),
        "relative_residual_of_published": _round_values(model.joints, found.published_residual),
        "base_parameters": {
            model.names[column]: {
                "value": float(f"{value:.5g}"),
                "deviation": float(f"{deviation:.2g}"),
                "share_of_effort": float(f"{share:.2g}"),
            }
            for column, value, deviation, share in zip(
                found.base.columns,
                found.base_values,
                found.base_deviations,
                found.base_shares,
                strict=True,
            )
        },
    }


def _body(pseudo: Vector) -> BodyInertia:
    """Return the body with this pseudo-inertia, shape (4, 4)."""
    mass = float(pseudo[3, 3])
    centre = pseudo[:3, 3] / mass
    second = pseudo[:3, :3] - mass * np.outer(centre, centre)
    tensor = np.trace(second) * np.eye(3) - second
    rows = (tensor + tensor.T) / 2.0
    return BodyInertia.model_validate({"mass": mass, "centre": centre.tolist(), "tensor": rows.tolist()})


def _round_values(joints: Sequence[str], values: Vector) -> dict[str, float]:
    return {joint: round(value, 4) for joint, value in zip(joints, values.tolist(), strict=True)}
