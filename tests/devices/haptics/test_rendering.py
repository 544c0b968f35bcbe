from copy import deepcopy
from math import inf, nan

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from devices.haptics.contact import ZERO, Plane, check_planes, planes_of
from devices.haptics.rendering import DEAD_RECKONING, Renderer
from devices.vendor_axes import Vector3
from schemas.ros import Vector3 as Vector3Message
from schemas.trocar_msgs import ContactModel, ContactPlane

MOST_K, MOST_B = 400.0, 4.0
TABLE = Plane(0.0, 0.0, 1.0, 0.0, 0.0, 200.0, 1.0, 0.0)
ROUGH = TABLE._replace(damping=0.0, friction=0.5)

near = st.floats(-0.02, 0.02)
points = st.tuples(near, near, near)
velocities = st.tuples(*3 * [st.floats(-0.5, 0.5)])
normals = (
    st.tuples(*3 * [st.floats(-1.0, 1.0)])
    .map(np.array)
    .filter(lambda v: np.linalg.norm(v) > 0.01)
    .map(lambda v: tuple((v / np.linalg.norm(v)).tolist()))
)
planes = st.builds(
    lambda n, *rest: Plane(*n, *rest),
    normals,
    st.floats(-0.01, 0.03),
    st.just(0.0),
    st.floats(0.0, 800.0),
    st.floats(0.0, 8.0),
    st.just(0.0),
)
# what sticks whatever comes
rough_planes = st.builds(lambda p, mu: p._replace(friction=mu), planes, st.sampled_from([0.0, 1e3]))


def _force(planes: list[Plane], position: Vector3, velocity: Vector3 = ZERO, age: float = 0.0) -> np.ndarray:
    return np.array(Renderer(MOST_K, MOST_B).force(planes, age, position, velocity))


@given(planes, points, velocities)
def test_one_plane_is_a_spring_and_a_damper_along_its_normal(
    plane: Plane, position: Vector3, velocity: Vector3
) -> None:
    n = np.array(plane[:3])
    depth = plane.distance - n @ position
    push = (
        max(0.0, min(plane.stiffness, MOST_K) * depth - min(plane.damping, MOST_B) * (n @ velocity))
        if depth > 0.0
        else 0.0
    )
    assert _force([plane], position, velocity) == pytest.approx(push * n, abs=1e-12)


def test_a_surface_goes_on_for_50_ms_and_no_longer() -> None:
    rising = TABLE._replace(velocity=0.1, damping=0.0)
    heights = [_force([rising], (0.0, 0.0, 0.0), age=age)[2] / 200.0 for age in (0.0, 0.01, 0.05, 0.09)]
    assert heights == pytest.approx([0.0, 0.001, 0.005, 0.005])


def test_damping_is_against_the_motion_of_the_surface() -> None:
    rising = TABLE._replace(distance=0.01, velocity=0.1)
    assert _force([rising], ZERO, (0.0, 0.0, 0.1))[2] == pytest.approx(2.0)
    assert _force([rising], ZERO, (0.0, 0.0, 0.0))[2] == pytest.approx(2.1)
    # where it stopped
    assert _force([rising], ZERO, (0.0, 0.0, 0.0), age=DEAD_RECKONING)[2] == pytest.approx(0.015 * 200.0)


@given(st.lists(rough_planes, min_size=1, max_size=4), points)
def test_no_direction_is_stiffer_or_more_damped_than_allowed(planes: list[Plane], position: Vector3) -> None:
    depths = [p.distance - np.dot(p[:3], position) for p in planes]
    assume(all(abs(depth) > 1e-4 for depth in depths))
    renderer = Renderer(MOST_K, MOST_B)
    renderer.force(planes, 0.0, position, ZERO)  # where it sticks
    stiffness, damping = np.zeros((3, 3)), np.zeros((3, 3))
    undamped = [p._replace(damping=0.0) for p in planes]
    for axis, step in enumerate(1e-6 * np.eye(3)):
        ends = [
            deepcopy(renderer).force(undamped, 0.0, tuple(np.array(position) + side * step), ZERO)
            for side in (1, -1)
        ]
        stiffness[axis] = np.subtract(*ends) / -2e-6
        # pushed hard enough that none lets go
        smooth = [p._replace(friction=0.0, stiffness=400.0) for p in planes]
        ends = [deepcopy(renderer).force(smooth, 0.0, position, tuple(side * step)) for side in (1, -1)]
        damping[axis] = np.subtract(*ends) / -2e-6
    assert np.linalg.norm(stiffness, 2) <= MOST_K * (1 + 1e-6)
    assert np.linalg.norm(damping, 2) <= MOST_B * (1 + 1e-6)


def test_walls_that_stand_square_keep_their_stiffness() -> None:
    corner = [
        Plane(1, 0, 0, 0, 0, 400.0, 0, 0),
        Plane(0, 1, 0, 0, 0, 400.0, 0, 0),
        Plane(0, 0, 1, 0, 0, 400.0, 0, 0),
    ]
    assert _force(corner, (-0.001, -0.002, -0.003)) == pytest.approx([0.4, 0.8, 1.2])
    assert _force([corner[0]] * 4, (-0.001, 0, 0)) == pytest.approx([0.4, 0, 0])


def test_friction_holds_a_hand_and_does_not_chatter() -> None:
    renderer = Renderer(MOST_K, MOST_B)
    renderer.force([ROUGH], 0.0, (0.0, 0.0, -0.01), ZERO)  # 2 N: the cone's radius is 1 N, 5 mm of the spring
    held = [
        renderer.force([ROUGH], 0.0, (0.002, 0.0, -0.01), (1e-4 * (-1) ** i, 0.0, 0.0)) for i in range(10)
    ]
    assert len(set(held)) == 1
    assert held[0] == pytest.approx((-0.4, 0.0, 2.0))
    assert renderer.force([ROUGH], 0.0, (0.001, 0.0, -0.01), ZERO)[0] == pytest.approx(-0.2)


def test_friction_slides_at_the_cone_and_sticks_where_the_hand_stops() -> None:
    renderer = Renderer(MOST_K, MOST_B)
    forces = [renderer.force([ROUGH], 0.0, (0.001 * i, 0.0, -0.01), ZERO) for i in range(30)]
    assert [f[0] for f in forces[6:]] == pytest.approx([-1.0] * 24)
    back = renderer.force([ROUGH], 0.0, (0.029 - 0.005, 0.0, -0.01), ZERO)
    assert back == pytest.approx((0.0, 0.0, 2.0))  # the spring is slack 5 mm behind
    assert renderer.force([ROUGH], 0.0, (0.029 - 0.015, 0.0, -0.01), ZERO)[0] == pytest.approx(1.0)


def test_friction_starts_anew_with_the_contact() -> None:
    renderer = Renderer(MOST_K, MOST_B)
    for x, z in ((0.0, -0.01), (0.003, -0.01), (0.003, 0.001)):
        renderer.force([ROUGH], 0.0, (x, 0.0, z), ZERO)
    assert renderer.force([ROUGH], 0.0, (0.004, 0.0, -0.01), ZERO) == pytest.approx((0.0, 0.0, 2.0))


@given(planes, st.floats(0.0, 2.0), st.lists(st.tuples(points, velocities), max_size=8))
def test_friction_stays_in_its_cone(
    plane: Plane, friction: float, way: list[tuple[Vector3, Vector3]]
) -> None:
    renderer = Renderer(MOST_K, MOST_B)
    for position, velocity in way:
        force = np.array(renderer.force([plane._replace(friction=friction)], 0.0, position, velocity))
        push = _force([plane], position, velocity)
        assert np.linalg.norm(force - push) <= friction * np.linalg.norm(push) + 1e-9
        assert np.dot(force - push, plane[:3]) == pytest.approx(0.0, abs=1e-9)


@given(
    st.lists(st.builds(lambda p, mu: p._replace(friction=mu), planes, st.floats(0.0, 2.0)), max_size=4),
    st.lists(points, max_size=8),
)
def test_friction_of_several_planes_stays_in_the_sum_of_their_cones(
    planes: list[Plane], way: list[Vector3]
) -> None:
    # of four together, not too stiff
    planes = [p._replace(damping=0.0, stiffness=min(p.stiffness, 100.0)) for p in planes]
    renderer = Renderer(MOST_K, MOST_B)
    for position in way:
        force = np.array(renderer.force(planes, 0.0, position, ZERO))
        pushes = [_force([p._replace(friction=0.0)], position) for p in planes]
        most = sum(p.friction * np.linalg.norm(push) for p, push in zip(planes, pushes, strict=True))
        assert np.linalg.norm(force - sum(pushes, np.zeros(3))) <= most + 1e-9


GOOD = TABLE._asdict()


@pytest.mark.parametrize(
    "change",
    [
        {"nx": nan},
        {"nz": 0.9},
        {"nz": 0.0},
        {"nz": inf},
        {"distance": nan},
        {"velocity": inf},
        {"stiffness": -1.0},
        {"damping": -0.1},
        {"friction": nan},
    ],
)
def test_what_is_no_plane(change: dict[str, float]) -> None:
    assert check_planes([TABLE, Plane(**{**GOOD, **change})]) is None


def test_at_most_four_planes_of_unit_normals() -> None:
    assert check_planes([TABLE] * 4) == (TABLE,) * 4
    assert check_planes([TABLE] * 5) is None
    assert check_planes([TABLE._replace(nz=1.0 + 1e-6)]) == (TABLE,)


def test_planes_of_a_message() -> None:
    plane = ContactPlane(
        normal=Vector3Message(y=1.0), distance=0.1, velocity=0.2, stiffness=3.0, damping=0.4, friction=0.5
    )
    assert planes_of(ContactModel(header={}, planes=[plane])) == (
        Plane(0.0, 1.0, 0.0, 0.1, 0.2, 3.0, 0.4, 0.5),
    )
