"""From a URDF or MJCF model to the file of a jaw: links, hinge, closed position, surfaces. SI, radians."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import cos, degrees, radians, sin
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.dvrk.end_effectors.own_jaw import LONGEST, SHORTEST, Finger, JawFile
from schemas.errors import ScenarioError, did_you_mean
from schemas.vectors import Vector

__all__ = ["ImportedTip", "import_tip"]

_OPENING = radians(60.0)
"""Largest angle between the fingers where the model states none: as the dVRK's forceps."""
_PAD = 0.4
"""Part of the length where the pads begin: the hinge's eyes overlap and say nothing about closing."""
_WIDEST = radians(140.0)
"""Largest angle between the fingers at 0: beyond, either side might be the inner one."""
_MOST_FACES = 20_000
_KEEP_VISUALS = '<mujoco><compiler discardvisual="false" fusestatic="false"/></mujoco>'


@dataclass(frozen=True)
class ImportedTip:
    """A jaw, ready to write, and what was taken from the model."""

    file: JawFile
    report: list[str]


@dataclass(frozen=True)
class _ReadFinger:
    """A finger in the frame of the model, every joint at 0."""

    link: str
    mass: float
    anchor: Vector
    """A point of the hinge, shape (3,)."""
    axis: Vector
    lower: float
    upper: float
    """Range of the joint; equal: none stated."""
    vertices: Vector
    faces: NDArray[np.int32]

    def offsets(self, hinge: Vector) -> Vector:
        """Return the vertices from the hinge, across `hinge`, shape (n, 3)."""
        out = self.vertices - self.anchor
        return out - np.outer(out @ hinge, hinge)


def import_tip(
    path: Path,
    *,
    name: str,
    fingers: Sequence[str] = (),
    opening: float | None = None,
    scale: float = 1.0,
) -> ImportedTip:
    """Return the jaw of a model.

    Args:
        path: a .urdf file, or an MJCF file (.xml).
        name: name of the new instrument.
        fingers: both links; empty: the only pair of links with a common hinge.
        opening: largest angle between the fingers, rad; None: the joints' ranges.
        scale: metres per unit of the model.

    Raises ScenarioError with the reason and the remedy if the model has no such jaw.
    """
    spec = _read(path)
    named = _pair(path, spec, fingers)
    _keep_meshes(path, spec, [body for link in named for body in _rigid_with(spec.body(link))])
    one, other = _read_fingers(path, spec, named, scale)
    if abs(float(one.axis @ other.axis)) < cos(radians(2.0)):
        raise _refusal(path, f"the hinges of '{one.link}' and '{other.link}' are not parallel")
    hinge = one.axis
    gap = other.anchor - one.anchor
    if np.linalg.norm(gap - (gap @ hinge) * hinge) > 1e-3:
        raise _refusal(path, f"'{one.link}' and '{other.link}' turn about two axes, farther apart than 1 mm")
    length = max(float(np.linalg.norm(f.offsets(hinge), axis=1).max()) for f in (one, other))
    if not SHORTEST <= length <= LONGEST:
        raise _refusal(
            path,
            f"the fingers are {length:.4g} m long, not {SHORTEST:g} to {LONGEST:g} m; for a model in mm"
            " state --scale 0.001",
        )
    return _imported(path, name, (one, other), hinge, length, opening)


def _imported(
    path: Path,
    name: str,
    pair: tuple[_ReadFinger, _ReadFinger],
    hinge: Vector,
    length: float,
    stated: float | None,
) -> ImportedTip:
    both = sum((_direction(finger, hinge, length) for finger in pair), np.zeros(3))
    if np.linalg.norm(both) < 2.0 * cos(_WIDEST / 2.0):
        raise _refusal(
            path,
            f"at 0 the fingers are more than {degrees(_WIDEST):.0f} degrees apart, so which side closes is"
            " open; set the zero of the joints nearer to closed",
        )
    middle = _unit(both)
    angles = [_pad_angles(finger, hinge, middle, length) for finger in pair]  # about the hinge from `middle`
    if sum(angles[0]) < sum(angles[1]):
        pair, angles = (pair[1], pair[0]), [angles[1], angles[0]]
    closed = angles[0][0], angles[1][1]  # inner faces: of the left finger the smaller angle
    left, right = (
        _in_closed_jaw(finger, _turned(middle, hinge, angle), hinge)
        for finger, angle in zip(pair, closed, strict=True)
    )
    across = np.concatenate([left[:, 1], right[:, 1] + float((pair[1].anchor - pair[0].anchor) @ hinge)])
    left[:, 1] -= (centre := (across.min() + across.max()) / 2.0)
    right[:, 1] += float((pair[1].anchor - pair[0].anchor) @ hinge) - centre
    report = [f"fingers: left '{pair[0].link}', right '{pair[1].link}', {1e3 * length:.3g} mm from the hinge"]
    report.append(
        f"closed where the pads meet: {abs(degrees(closed[0] - closed[1])):.1f} degrees from the model's 0"
    )
    opening = stated if stated is not None else _opening(pair, hinge, closed, report)
    masses = [finger.mass for finger in pair]
    report.append(f"masses: {1e3 * masses[0]:.3g} g and {1e3 * masses[1]:.3g} g")
    made = [
        Finger.of(finger.mass, vertices, finger.faces)
        for finger, vertices in zip(pair, (left, right), strict=True)
    ]
    source = f"{path.name}: {pair[0].link}, {pair[1].link}"
    file = JawFile(name=name, source=source, length=length, opening=opening, left=made[0], right=made[1])
    return ImportedTip(file, report)


def _read(path: Path) -> mujoco.MjSpec:
    try:
        if path.suffix.lower() not in (".urdf", ".xml", ".mjcf"):
            hint = ": expand it first, xacro FILE > FILE.urdf" if path.suffix == ".xacro" else ""
            raise _refusal(path, f"no .urdf and no MJCF file (.xml){hint}")
        if path.suffix.lower() == ".urdf":
            # without this MuJoCo's reader drops what is only seen, and links without joints
            text = path.read_text(encoding="utf-8").replace("</robot>", f"{_KEEP_VISUALS}</robot>")
            return mujoco.MjSpec.from_string(text)
        return mujoco.MjSpec.from_file(str(path))
    except OSError as error:
        raise ScenarioError(f"cannot read '{path}': {error.strerror}") from error
    except ValueError as error:
        raise _refusal(path, str(error)) from error


def _pair(path: Path, spec: mujoco.MjSpec, stated: Sequence[str]) -> tuple[str, str]:
    """Return the names of both fingers."""
    links = {body.name: body for body in spec.bodies if body.name}
    for link in stated:
        if link not in links:
            raise _refusal(path, f"no link '{link}'.{did_you_mean(link, links)}")
    hinged = {name: body for name, body in links.items() if _is_hinged(body)}
    pairs = [
        (one, other)
        for one, other in combinations(hinged, 2)
        if hinged[one].parent == hinged[other].parent and (not stated or {one, other} == set(stated))
    ]
    if len(pairs) != 1:
        turning = ", ".join(hinged) or "none"
        found = "several pairs" if pairs else "no two links"
        raise _refusal(
            path,
            f"{found} turn on one parent as the fingers of a jaw do; links with a hinge: {turning}. Name both"
            " with --fingers LEFT,RIGHT. What is no jaw of two fingers is a file of Python: see"
            " docs/tutorials/own-instrument.md",
        )
    return pairs[0]


def _is_hinged(body: mujoco.MjsBody) -> bool:
    return [joint.type for joint in body.joints] == [mujoco.mjtJoint.mjJNT_HINGE]


def _rigid_with(body: mujoco.MjsBody) -> Iterator[mujoco.MjsBody]:
    """Yield the body, and bodies that are fixed on it."""
    yield body
    for child in body.bodies:
        if not child.joints:
            yield from _rigid_with(child)


def _keep_meshes(path: Path, spec: mujoco.MjSpec, kept: Sequence[mujoco.MjsBody]) -> None:
    """Find the mesh files of `kept`, and delete all others: a whole arm may be around the tip."""
    geoms = [geom for body in kept for geom in body.geoms if geom.type == mujoco.mjtGeom.mjGEOM_MESH]
    seen = [geom for geom in geoms if not geom.contype and not geom.conaffinity] or geoms
    if not geoms:
        raise _refusal(path, "the fingers have no mesh; boxes and cylinders are not taken")
    wanted = {geom.meshname for geom in seen}
    for geom in [geom for geom in spec.geoms if geom not in seen]:
        spec.delete(geom)
    for mesh in list(spec.meshes):
        if mesh.name not in wanted:
            spec.delete(mesh)
        elif mesh.file:
            mesh.file = str(_mesh_file(path, spec.meshdir, mesh.file))
    spec.meshdir = ""
    # a link of a drawing may have no mass or no inertia; here only the fingers' masses are read
    spec.compiler.boundmass, spec.compiler.boundinertia = 1e-9, 1e-15


def _mesh_file(path: Path, folder: str, named: str) -> Path:
    """Return the file of a mesh: the stated path, else the same name near the model."""
    direct = path.parent / folder / named
    if direct.is_file():
        return direct.resolve()
    words = [
        word for word in named.replace("\\", "/").split("/") if word not in ("", "package:", "file:", "..")
    ]
    around = list(path.resolve().parents)[:4]
    tails = [Path(*words[i:]) for i in range(len(words))]
    for candidate in (near / tail for tail in tails for near in around):  # longest part of the name first
        if candidate.is_file():
            return candidate
    for near in around[:2]:  # a ROS package has meshes beside the folder of models
        if found := sorted(near.glob(f"**/{words[-1]}")):
            return found[0]
    raise _refusal(
        path, f"the mesh '{named}' is not found; put '{words[-1]}' beside the model, or in a folder there"
    )


def _read_fingers(
    path: Path, spec: mujoco.MjSpec, named: tuple[str, str], scale: float
) -> tuple[_ReadFinger, _ReadFinger]:
    try:
        model = spec.compile()
    except ValueError as error:
        raise _refusal(path, f"{error}; meshes are read as .stl, .obj and .msh") from error
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    one, other = (_read_finger(path, spec, model, data, link, scale) for link in named)
    return one, other


def _read_finger(
    path: Path, spec: mujoco.MjSpec, model: mujoco.MjModel, data: mujoco.MjData, link: str, scale: float
) -> _ReadFinger:
    bodies = [model.body(body.name).id for body in _rigid_with(spec.body(link))]
    joint = int(model.body_jntadr[bodies[0]])
    vertices, faces, count = list[Vector](), list[NDArray[np.int32]](), 0
    for geom in (g for g in range(model.ngeom) if model.geom_bodyid[g] in bodies):
        mesh = int(model.geom_dataid[geom])
        at, number = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        face_at, face_number = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        points = np.array(model.mesh_vert[at : at + number], np.float64)
        vertices.append(points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
        faces.append(np.array(model.mesh_face[face_at : face_at + face_number], np.int32) + count)
        count += number
    if not vertices:
        raise _refusal(path, f"the finger '{link}' has no mesh; boxes and cylinders are not taken")
    if (total := sum(map(len, faces))) > _MOST_FACES:
        raise _refusal(
            path, f"the finger '{link}' has {total} faces, at most {_MOST_FACES}: simplify its mesh"
        )
    limited = bool(model.jnt_limited[joint])
    lower, upper = model.jnt_range[joint].tolist() if limited else (0.0, 0.0)
    return _ReadFinger(
        link,
        float(sum(model.body_mass[body] for body in bodies)),
        scale * data.xanchor[joint],
        data.xaxis[joint].copy(),
        lower,
        upper,
        scale * np.concatenate(vertices),
        np.concatenate(faces),
    )


def _direction(finger: _ReadFinger, hinge: Vector, length: float) -> Vector:
    """Return the direction from the hinge to the middle of the pad, shape (3,)."""
    out = finger.offsets(hinge)
    return _unit(out[np.linalg.norm(out, axis=1) > _PAD * length].mean(axis=0))


def _pad_angles(finger: _ReadFinger, hinge: Vector, middle: Vector, length: float) -> tuple[float, float]:
    """Return the smallest and the largest angle of the pad about the hinge, from `middle`, rad."""
    out = finger.offsets(hinge)
    out = out[np.linalg.norm(out, axis=1) > _PAD * length]
    angles = np.arctan2(out @ np.cross(hinge, middle), out @ middle)
    return float(angles.min()), float(angles.max())


def _in_closed_jaw(finger: _ReadFinger, ahead: Vector, hinge: Vector) -> Vector:
    """Return the vertices in the frame of a closed jaw, whose z is `ahead` of this finger, shape (n, 3)."""
    return (finger.vertices - finger.anchor) @ np.column_stack([np.cross(hinge, ahead), hinge, ahead])


def _opening(
    pair: tuple[_ReadFinger, _ReadFinger], hinge: Vector, closed: tuple[float, float], report: list[str]
) -> float:
    """Return the largest angle between the fingers, rad, by the ranges of both joints, at most pi."""
    total = 0.0
    for finger, inner, side in zip(pair, closed, (1.0, -1.0), strict=True):
        sign = 1.0 if finger.axis @ hinge > 0.0 else -1.0
        if finger.lower < finger.upper:
            outwards = finger.upper if sign * side > 0.0 else -finger.lower
            total += max(outwards + side * inner, 0.0)
    if total <= radians(1.0):
        report.append(
            f"no range of the joints: opens by {degrees(_OPENING):g} degrees; --opening states another"
        )
        return _OPENING
    total = min(total, radians(180.0))
    report.append(f"opens by {degrees(total):.4g} degrees, the joints' ranges; --opening states another")
    return total


def _turned(vector: Vector, axis: Vector, angle: float) -> Vector:
    """Return a vector across `axis` turned about it."""
    return cos(angle) * vector + sin(angle) * np.cross(axis, vector)


def _unit(vector: Vector) -> Vector:
    return vector / np.linalg.norm(vector)


def _refusal(path: Path, reason: str) -> ScenarioError:
    return ScenarioError(f"model {path}: {reason}")
