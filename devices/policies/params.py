"""Parameters of a policy in a session."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from devices.policies.policy import BACKENDS, check_backend
from devices.scene_arms import SceneArms
from hub.participant import Params
from robots.dvrk.crtk import Mounting
from robots.policies.contract import Contract
from robots.policies.terms import Terms
from schemas.quantity import Duration

__all__ = ["PolicyParams"]


class PolicyParams(Params):
    """Where the policy is, and the contract with it."""

    native_code = ("backend", "python")

    arms: SceneArms
    mounting: Mounting = "free"
    contract: Contract = Contract()
    backend: Annotated[str, AfterValidator(check_backend)] = Field(
        max_length=1000, description="; ".join(BACKENDS.values())
    )
    python: str = Field(
        default="",
        max_length=1000,
        description="interpreter of a policy in a process of its own, such as /opt/lerobot/bin/python;"
        " default: Trocar's",
    )
    time: Literal["simulated", "wall"] = Field(
        default="simulated",
        description=(
            "simulated: the session waits for every answer; wall: answers enter when they come, as on a robot"
        ),
    )
    timeout: Duration = Field(
        default=10_000_000_000,
        gt=0,
        description="longest wait for the start, and for an answer, in wall time",
    )
    episode: int = Field(default=0, ge=0, lt=2**31, description="number sent with the reset at the start")

    @property
    def terms(self) -> Terms:
        """The contract with all names."""
        return Terms.of(self.contract, self.arms.present_arms, self.mounting)
