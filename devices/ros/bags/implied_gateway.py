"""The gateway of a session without one: the topics of its motion controller, console and cameras."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from devices.ros.gateway import Gateway
from devices.ros.topics.row import Row
from hub.planning.plan import Plan, PlannedParticipant
from hub.recording.recording import Recording
from hub.recording.trust import trusted_parameters
from schemas.keys import Keys, topic
from schemas.ports import Port

__all__ = ["implied_gateway", "implied_routes"]

_NAME, _KIND = "ros", "ros2-zenoh"
"""The middleware makes no difference: the gateway is never opened."""
_MOTION, _CONSOLE, _CAMERA = "motion", "dvrk-console", "endoscope"
"""Kinds with ports named as topics, of a camera without the camera's name."""
_SHARED = ("arms", "mounting", "reference")
"""Parameters of a motion controller that a gateway has too."""


def implied_gateway(recording: Recording, plan: Plan, *, trust: bool) -> Gateway | None:
    """Return a gateway for the arms of the session's motion controller; None without such a controller.

    Raises TrustError if the motion controller asks for forbidden files.
    """
    motion = next(_of_kind(plan, _MOTION), None)
    if motion is None:
        return None
    trusted = trusted_parameters(recording, [motion.name], trust=trust)
    cameras = [camera.name for camera in _of_kind(plan, _CAMERA)]
    params = {key: value for key, value in trusted.last[motion.name].items() if key in _SHARED}
    own = replace(trusted, kinds={_NAME: _KIND}, last={_NAME: params | {"cameras": cameras}}, renewals=())
    made, _ = own.make(_NAME)
    if not isinstance(made, Gateway):
        raise TypeError(f"{made} is not a gateway, though its kind is one of gateways")
    return made


def implied_routes(plan: Plan, gateway: Gateway) -> Mapping[str, Sequence[tuple[Row, Port]]]:
    """Return published rows by topic of a recording, each with the port of the written values."""
    sources = {
        name: (one.name, port)
        for kind in (_CAMERA, _CONSOLE, _MOTION)
        for one in _of_kind(plan, kind)
        for port in one.ports
        if port.causality == "output"
        for name in (f"{one.name}/{port.name}" if kind == _CAMERA else port.name,)
    }
    keys, routes = Keys("any"), defaultdict[str, list[tuple[Row, Port]]](list)
    for row in gateway.rows:
        if row.way != "publish" or row.port is None or row.port.name not in sources:
            continue
        owner, port = sources[row.port.name]
        if port.type == row.type:
            routes[topic(keys.output("engine", owner, port.name))].append((row, port))
    return routes


def _of_kind(plan: Plan, kind: str) -> Iterator[PlannedParticipant]:
    return (one for one in plan.participants.values() if one.kind == kind)
