"""A thread behind a needle: a discrete elastic rod of MuJoCo (a flex of one dimension) from its base on.

Its first vertex is a point of the needle; the others are points with mass that move along x, y and z of the
world. The edges keep their length by constraints; bending is elastic. It touches nothing but the level that
it lies on: not jaws, not needles, not itself (docs/decisions/0074).
"""

from __future__ import annotations

import mujoco
import numpy as np

from engines.mujoco.model.objects import start_pose
from engines.mujoco.object_params import NeedleParams
from robots import rotation
from robots.training.needles import NeedleShape
from robots.training.threads import ThreadParams

__all__ = ["add", "node_body"]

_BENDING_LAG = 0.01
"""Damping of bending over its stiffness, s. Assumed."""
_TIGHT = {"solref": [1e-3, 1.0], "solimp": [0.999, 0.9999, 1e-4, 0.5, 2.0]}
"""Of the edges: with MuJoCo's defaults they are 13 % too long."""
_HIGHEST = 10.0
"""Upper end of a node's range over the level, m: none in practice."""
_RGBA = [0.35, 0.1, 0.55, 1.0]
"""Violet, as sutures of polyglactin are dyed."""


def node_body(needle: str, node: int) -> str:
    """Return the name of the body of a node, 1 being the first behind the base."""
    return f"{needle}/thread{node}"


def add(
    spec: mujoco.MjSpec, name: str, params: NeedleParams, thread: ThreadParams, level: float, seed: int | None
) -> None:
    """Add the thread of the needle `name`, straight behind its base; it lies at `level` (m) in the world."""
    position, turn = start_pose(name, params, seed)
    frame = NeedleShape(params.radius, params.arc, params.wire_radius).frames["base"]
    base = position + rotation.matrix(turn) @ frame[:3, 3]
    forward = rotation.matrix(turn) @ frame[:3, 1]
    bodies, vertices = [name], frame[:3, 3].tolist()
    for node in range(1, thread.segments + 1):
        body = spec.worldbody.add_body(name=node_body(name, node), pos=base - node * thread.segment * forward)
        body.mass, body.explicitinertial = thread.node_mass, True
        body.gravcomp = 1.0 - thread.true_mass / thread.node_mass  # it weighs what it is, and no more
        body.inertia = [thread.node_mass * thread.radius**2] * 3
        for axis, along in zip("xyz", np.eye(3), strict=True):
            body.add_joint(name=f"{body.name}/{axis}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=along)
        upright = spec.joint(f"{body.name}/z")
        upright.limited = True
        upright.range = np.array([level + thread.radius - body.pos[2], _HIGHEST])
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[thread.radius, 0.0, 0.0],
            mass=0.0,
            rgba=_RGBA,
            contype=0,
            conaffinity=0,
        )
        bodies.append(body.name)
        vertices += [0.0, 0.0, 0.0]
    edges = np.stack([np.arange(thread.segments), np.arange(1, thread.segments + 1)], axis=1)
    flex = f"{name}/thread"
    spec.add_flex(
        name=flex,
        dim=1,
        radius=thread.radius,
        vertbody=bodies,
        vert=vertices,
        elem=edges.ravel().tolist(),
        young=thread.young,
        poisson=0.3,  # without effect: the rod does not twist
        damping=_BENDING_LAG,
        section=mujoco.mjtFlexSection.mjFLEXSECTION_CIRCLE,
        contype=0,
        conaffinity=0,
        rgba=_RGBA,
    )
    spec.add_equality(name=flex, type=mujoco.mjtEq.mjEQ_FLEX, name1=flex, **_TIGHT)
