"""A person's hand on the gripper of a master: a spring and damper of six degrees of freedom."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from schemas.quantity import Damping, Stiffness

__all__ = ["HandOnMaster"]


class HandOnMaster(BaseModel):
    """Stiffness and damping of a hand that holds a gripper; assumed, as of a relaxed hand."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    stiffness: Stiffness = Field(default=400.0, gt=0.0, description="force per distance from the hand's pose")
    damping: Damping = Field(default=30.0, ge=0.0, description="force per velocity relative to the hand's")
    turn_stiffness: float = Field(
        default=1.5, gt=0.0, allow_inf_nan=False, description="torque per angle from the hand's pose, N m/rad"
    )
    turn_damping: float = Field(
        default=0.04, ge=0.0, allow_inf_nan=False, description="torque per angular velocity, N m s/rad"
    )
