"""The nodes and surfaces of organs as outputs of a tissue engine."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from engines.tissue.organs.body import Body, ChangingBody
from engines.tissue.params import PressedOrgansParams
from hub.participant import Value, signal_out
from schemas.ports import Port
from schemas.ros import Header, Time
from schemas.trocar_msgs import SoftBodyState, SurfaceChange

__all__ = ["node_ports", "node_states", "surface_changes", "surface_ports"]


def node_ports(params: PressedOrgansParams) -> tuple[Port, ...]:
    """Return a port of the nodes of every organ."""
    meaning = "positions of the nodes; the surface triangles come with the first"
    return tuple(
        signal_out(f"{organ}/nodes", SoftBodyState, meaning, frame="world", period_ns=params.node_period)
        for organ in params.organs
    )


def surface_ports(params: PressedOrgansParams) -> tuple[Port, ...]:
    """Return a port of the changed surface of every organ, for engines that change surfaces.

    It is due with the nodes, so that both are always of the same time.
    """
    meaning = "difference of the surface from the triangles at time 0: faces changed, appended and gone"
    return tuple(
        signal_out(f"{organ}/surface", SurfaceChange, meaning, frame="world", period_ns=params.node_period)
        for organ in params.organs
    )


def surface_changes(organs: Iterable[ChangingBody], t: int) -> dict[str, Value]:
    """Return the changed surface of every organ at `t` ns."""
    return {f"{organ.name}/surface": organ.surface.change(organ.name, t) for organ in organs}


def node_states(organs: Iterable[Body], t: int) -> dict[str, Value]:
    """Return the nodes of every organ as last read, at `t` ns; at time 0 with the surface."""
    header = Header(stamp=Time.from_ns(t), frame_id="world")
    outputs: dict[str, Value] = {}
    for organ in organs:
        triangles = organ.mesh.triangles.astype(np.uint32).ravel() if t == 0 else np.zeros(0, np.uint32)
        outputs[f"{organ.name}/nodes"] = SoftBodyState(
            header=header,
            body=organ.name,
            nodes_m=organ.nodes.astype(np.float32).ravel(),
            triangles=triangles,
        )
    return outputs
