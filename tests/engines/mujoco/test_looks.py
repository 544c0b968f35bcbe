"""Looks: closed meshes of the published size, few triangles, the same bytes every time, pads that meet."""

from __future__ import annotations

import subprocess
import sys
from typing import get_args

import numpy as np
import pytest

pytest.importorskip("manifold3d", reason="needs the extra mujoco")

from engines.mujoco.looks import Part, Primitive, collision, parts
from robots.dvrk.instruments import instruments
from robots.dvrk.linkage import ECM, PSM, Linkage
from robots.dvrk.setup_joints import JOINT_NAMES, CartArm
from schemas.errors import MotionError
from schemas.vectors import Vector

FIXED = ("psm", "ecm", "cart", *(f"suj/{arm}" for arm in get_args(CartArm)))
INSTRUMENTS = tuple(f"instrument/{name}" for name in instruments())
GRASPING = tuple(
    f"instrument/{number}"
    for number in ("400006", "420006", "400049", "420049", "400093", "400172", "400205")
)

TOLERANCE = 0.005
"""m. Rounded edges and what we left out of the CAD's outline."""


def bounds(what: str, body: str, names: tuple[str, ...] = ()) -> Vector:
    """Return the lowest and the highest corner of a body's parts, shape (2, 3)."""
    vertices = np.concatenate(
        [part.vertices for part in parts(what)[body] if not names or part.name in names]
    )
    return np.array([vertices.min(axis=0), vertices.max(axis=0)])


def triangles(what: str) -> int:
    """Return how many triangles a look has."""
    return sum(len(part.faces) for shown in parts(what).values() for part in shown)


def test_every_mesh_is_closed_and_faces_outward() -> None:
    for what in (*FIXED, *INSTRUMENTS):
        check_meshes(what)


def check_meshes(what: str) -> None:
    """Every edge of a mesh, sharp ones merged, occurs once in each direction, and the volume is positive."""
    names = [part.name for shown in parts(what).values() for part in shown]
    assert names
    assert len(set(names)) == len(names)
    for shown in parts(what).values():
        for part in shown:
            _, merged = np.unique(part.vertices, axis=0, return_inverse=True)
            faces = merged.reshape(-1)[part.faces]
            edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
            forward, backward = ({tuple(edge) for edge in side.tolist()} for side in (edges, edges[:, ::-1]))
            assert forward == backward, part.name
            corners = part.vertices[part.faces]
            assert np.sum(np.cross(corners[:, 0], corners[:, 1]) * corners[:, 2]) > 0.0, part.name


def test_the_whole_cart_has_about_ten_thousand_triangles() -> None:
    """Column, setup joints, endoscope arm and three arms with needle drivers."""
    arms = 3 * (triangles("psm") + triangles("instrument/400006")) + triangles("ecm")
    setup = triangles("cart") + sum(triangles(f"suj/{arm}") for arm in get_args(CartArm))
    assert 8_000 < arms + setup < 11_500


@pytest.mark.parametrize(
    ("what", "body", "low", "high"),
    [
        ("psm", "base", (-0.067, -0.776, -0.152), (0.067, -0.369, 0.067)),
        ("psm", "yaw", (-0.081, -0.677, -0.133), (0.081, -0.381, 0.012)),
        ("psm", "pitch_bottom", (-0.0475, -0.567, 0.136), (0.0475, -0.037, 0.194)),
        ("psm", "pitch_top", (-0.0475, -0.563, 0.172), (0.0475, -0.033, 0.190)),
        ("psm", "pitch", (-0.039, -0.068, -0.037), (0.039, 0.012, 0.539)),
        ("ecm", "base", (-0.079, -0.695, -0.102), (0.079, -0.539, 0.059)),
        ("ecm", "yaw", (-0.088, -0.538, -0.101), (0.088, -0.272, 0.069)),
        ("ecm", "pitch", (-0.026, -0.116, -0.006), (0.025, 0.013, 0.570)),
        ("ecm", "insertion", (-0.028, -0.061, 0.373), (0.026, -0.028, 0.491)),
        ("ecm", "roll", (-0.035, -0.040, 0.0), (0.035, 0.039, 0.612)),
        ("suj/PSM2", "lift", (0.0775, -0.1741, 0.430), (0.2637, -0.0291, 0.7611)),
        ("suj/PSM2", "shoulder", (0.1187, -0.1741, 0.7611), (0.6898, -0.0291, 1.0551)),
        ("suj/PSM2", "elbow", (0.563, -0.1616, 0.9324), (1.1088, -0.0416, 1.1574)),
        ("suj/PSM2", "wrist", (0.8928, -0.1555, 0.8116), (1.1168, -0.0477, 0.9324)),
        ("suj/PSM2", "tilt", (1.1148, -0.1496, 0.6304), (1.5082, -0.0537, 0.9073)),
        ("cart", "cart", (-0.456, -0.568, -0.166), (0.456, 0.365, 1.801)),
    ],
)
def test_outer_dimensions_are_the_published_ones(
    what: str, body: str, low: tuple[float, ...], high: tuple[float, ...]
) -> None:
    """Bounding boxes of the CAD meshes in med-air/SurRoL (PSM) and jhu-dvrk/dvrk_model (ECM, SUJ).

    They are carried to the frame of the look.
    """
    names = ("yaw",) if (what, body) == ("psm", "yaw") else ()
    np.testing.assert_allclose(bounds(what, body, names), [low, high], atol=TOLERANCE)


@pytest.mark.parametrize(("what", "linkage"), [("psm", PSM), ("ecm", ECM)])
def test_links_reach_their_pivots(what: str, linkage: Linkage) -> None:
    """Two bodies that meet in a pivot both have something there."""
    pivots = [
        ((joint.name, joint.parent), joint.pivot) for joint in linkage.joints if joint.follows == "pitch"
    ]
    pivots += [(pin.bodies, pin.position) for pin in linkage.pins]
    for bodies, pivot in pivots:
        for body in bodies:
            low, high = bounds(what, body)
            assert np.all(low[1:] < pivot[1:]), (body, pivot)
            assert np.all(pivot[1:] < high[1:]), (body, pivot)


@pytest.mark.parametrize("arm", get_args(CartArm))
def test_setup_joints_have_a_look_for_each_joint(arm: CartArm) -> None:
    """Also where a joint of the ECM's has nothing to show."""
    assert tuple(parts(f"suj/{arm}")) == JOINT_NAMES


@pytest.mark.parametrize("what", GRASPING)
def test_pads_meet_in_the_plane_of_the_axis_and_the_tip(what: str) -> None:
    """Meshes and boxes of both fingers touch that plane from either side and do not cross it."""
    looks, boxes = parts(what), collision(what)
    for side, name in ((1.0, "jaw_left"), (-1.0, "jaw_right")):
        (box,) = boxes[name]
        assert isinstance(box, Primitive)
        face = side * box.pose[:3, 0] @ box.pose[:3, 3] - box.size[0]
        assert abs(face) < 1e-12
        pad = (
            next(part for part in looks[name] if part.name == f"{name}_pad").vertices @ box.pose[:3, 0] * side
        )
        assert pad.min() == pytest.approx(0.0, abs=1e-9)
        assert pad.max() < 5e-4
        end = box.pose[2, 3] - box.size[2]
        assert end == pytest.approx(bounds(what, name)[0, 2], abs=1e-7)


@pytest.mark.parametrize("what", [*FIXED, *GRASPING, "instrument/palpation-probe"])
def test_what_collides_is_convex_and_belongs_to_a_body_with_a_look(what: str) -> None:
    """No vertex of a hull lies outside any of its faces."""
    for body, shapes in collision(what).items():
        assert body in parts(what)
        for shape in shapes:
            if isinstance(shape, Part):
                corners = shape.vertices[shape.faces]
                normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
                normals /= np.linalg.norm(normals, axis=1, keepdims=True)
                outside = np.max(
                    normals @ shape.vertices.T - np.sum(normals * corners[:, 0], axis=1, keepdims=True)
                )
                assert outside < 1e-6
            else:
                np.testing.assert_allclose(shape.pose[:3, :3] @ shape.pose[:3, :3].T, np.eye(3), atol=1e-12)


@pytest.mark.long
def test_the_same_bytes_in_another_process() -> None:
    """Meshes do not depend on what was built before, nor on the process."""
    script = (
        "import hashlib; from engines.mujoco.looks import parts; h = hashlib.sha256()\nfor what in"
        " {whats!r}:\n for shown in parts(what).values():\n  for p in shown: h.update(p.vertices.tobytes() +"
        " p.faces.tobytes())\nprint(h.hexdigest())"
    )
    whats = (*FIXED, *GRASPING)
    digests = {
        subprocess.run(
            [sys.executable, "-P", "-c", script.format(whats=order)],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for order in (whats, whats)
    }
    assert len(digests) == 1


@pytest.mark.parametrize("what", ["arm", "suj/PSM4", "instrument/400007x"])
def test_an_unknown_look_is_refused_by_name(what: str) -> None:
    """The message repeats what was asked for."""
    with pytest.raises(MotionError, match=what.removeprefix("instrument/")):
        parts(what)


@pytest.mark.parametrize("what", [*FIXED, *GRASPING, "instrument/400183", "instrument/palpation-probe"])
def test_whatever_is_seen_collides(what: str) -> None:
    """Every body with a look has a shape for contact."""
    assert set(collision(what)) == {body for body, shown in parts(what).items() if shown}
    assert all(collision(what).values())
