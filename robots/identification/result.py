"""From a fit to the file that a scenario names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robots.dvrk.instruments import Instrument
from robots.dvrk.own_dynamics import BodyInertia, DiscLosses, JointLosses, OwnDynamics
from robots.identification.fit import Fit
from robots.identification.linear_model import ARM_BODIES, LinearModel, pseudo_inertias
from schemas.vectors import Vector

__all__ = ["own_dynamics"]


def own_dynamics(found: Fit, tool: Instrument, cutoff: float, recordings: Sequence[str]) -> OwnDynamics:
    """Return the content of the file: `found` for a PSM with `tool`, with how it was found."""
    model = LinearModel(tool)
    values = {name: found.parameters[part].tolist() for name, part in model.parts.items()}
    bodies = pseudo_inertias(found.parameters[model.parts["body"]])
    losses = {
        joint: JointLosses(armature=armature, stiffness=stiffness, offset=offset)
        for joint, armature, stiffness, offset in zip(
            model.joints, values["armature"], values["stiffness"], values["offset"], strict=True
        )
    }
    for joint, viscous, coulomb in zip(model.joints, values["viscous"], values["coulomb"], strict=False):
        losses[joint] = losses[joint].model_copy(update={"viscous": viscous, "coulomb": coulomb})
    return OwnDynamics(
        instrument=tool.name,
        bodies={name: _body(pseudo) for name, pseudo in zip(ARM_BODIES, bodies, strict=True)},
        joints=losses,
        discs=[
            DiscLosses(viscous=viscous, coulomb=coulomb)
            for viscous, coulomb in zip(values["disc_viscous"], values["disc_coulomb"], strict=True)
        ],
        fit={
            "recordings": list(recordings),
            "cutoff_hz": cutoff,
            "samples": len(found.time),
            "condition_number": float(f"{found.condition:.3g}"),
            "relative_residual": _rounded(model.joints, found.residual),
            "relative_residual_of_published": _rounded(model.joints, found.published_residual),
            "base_parameters": {
                model.names[column]: {"value": float(f"{value:.5g}"), "deviation": float(f"{deviation:.2g}")}
                for column, value, deviation in zip(
                    found.base.columns, found.base_values, found.base_deviations, strict=True
                )
            },
        },
    )


def _body(pseudo: Vector) -> BodyInertia:
    """Return the body with this pseudo-inertia, shape (4, 4)."""
    mass = float(pseudo[3, 3])
    centre = pseudo[:3, 3] / mass
    second = pseudo[:3, :3] - mass * np.outer(centre, centre)
    tensor = np.trace(second) * np.eye(3) - second
    rows = (tensor + tensor.T) / 2.0
    return BodyInertia.model_validate({"mass": mass, "centre": centre.tolist(), "tensor": rows.tolist()})


def _rounded(joints: Sequence[str], values: Vector) -> dict[str, float]:
    return {joint: round(value, 4) for joint, value in zip(joints, values.tolist(), strict=True)}
