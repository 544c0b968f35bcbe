"""The gateway to programs in plain Python: ROS 2 over Zenoh, behind the secret of the session."""

from __future__ import annotations

from pydantic import Field

from devices.ros.zenoh.gateway import ZenohGateway, ZenohParams
from schemas.quantity import Duration

__all__ = ["ProgramsGateway", "ProgramsParams"]


class ProgramsParams(ZenohParams):
    """As of `ros2-zenoh`, with faster states."""

    publish_period: Duration = Field(
        default=4_000_000,
        ge=500_000,
        description="of all states in wall time, whatever the step, while a program reads them",
    )


class ProgramsGateway(ZenohGateway):
    """The kind `programs`: for programs of the session's user, or with the certificate `console`."""

    kind = "programs"
    params_model = ProgramsParams
    demands_secret = True
