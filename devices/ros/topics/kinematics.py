"""CRTK's kinematics services of the simulated arms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from devices.ros.topics.row import Row
from devices.ros.transport import ServiceHandler
from robots.dvrk.kinematics_queries import KinematicsQueries
from robots.serial_chain import SerialChain
from schemas.codec import decode, encode
from schemas.crtk import (
    ForwardKinematicsRequest,
    ForwardKinematicsResponse,
    InverseKinematicsRequest,
    InverseKinematicsResponse,
)
from schemas.ros import Point, Pose, Quaternion
from schemas.vectors import Vector

__all__ = ["kinematics_handler"]


def kinematics_handler(
    row: Row, chain: SerialChain, base: Callable[[], Vector | None], port: str = ""
) -> ServiceHandler:
    """Return the handler of the service `row`.

    Args:
        row: forward or inverse kinematics, in the arm's base (`local/...`) or in the reference frame.
        chain: the arm's kinematics.
        base: returns the pose, shape (7,), of the arm's base in the reference frame, if that is known.
        port: name of that pose, for errors.
    """
    queries = KinematicsQueries(chain)

    def forward(payload: bytes) -> bytes:
        base_pose = None if row.name.startswith("local/") else base()
        if base_pose is None and not row.name.startswith("local/"):
            return encode(
                ForwardKinematicsResponse(message=f"{port} has no value now: is the session running?")
            )
        answer = queries.forward(decode(ForwardKinematicsRequest, payload).jp, base_pose)
        return encode(
            ForwardKinematicsResponse(cp=_pose(answer.value), result=answer.result, message=answer.message)
        )

    def inverse(payload: bytes) -> bytes:
        request = decode(InverseKinematicsRequest, payload)
        p, q = request.cp.position, request.cp.orientation
        answer = queries.inverse(np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w]), request.jp)
        return encode(
            InverseKinematicsResponse(jp=answer.value, result=answer.result, message=answer.message)
        )

    return inverse if row.name == "inverse_kinematics" else forward


def _pose(value: Vector) -> Pose:
    x, y, z, qx, qy, qz, qw = value.tolist()
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))
