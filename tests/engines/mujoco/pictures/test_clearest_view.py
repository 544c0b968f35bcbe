"""The camera in the room stands where the least of the subject is hidden."""

import mujoco
import numpy as np
import pytest

from engines.mujoco.pictures.clearest_view import Sight, clearest_position

WALL = "<geom type='box' size='0.2 0.01 0.3' pos='{} {} 0.1' euler='0 0 {}'/>"


def sight(*walls):
    geoms = "".join(WALL.format(*wall) for wall in walls)
    return Sight(
        mujoco.MjModel.from_xml_string(
            f"<mujoco><compiler angle='radian'/><worldbody>{geoms}<body name='ball' pos='0 0 0.01'>"
            "<freejoint/><geom size='0.01' pos='0 0 0'/></body></worldbody></mujoco>"
        ),
        [np.array([0.1, 0.0, 0.02, 1.0, 0.0, 0.0, 0.0]), np.array([-0.1, 0.0, 0.02, 1.0, 0.0, 0.0, 0.0])],
    )


@pytest.mark.parametrize("open_side", range(4))
def test_the_camera_is_at_the_open_side_of_three_walls(open_side):
    sides = [(0.15, 0.0, np.pi / 2), (0.0, 0.15, 0.0), (-0.15, 0.0, np.pi / 2), (0.0, -0.15, 0.0)]
    found = clearest_position(
        sight(*(side for at, side in enumerate(sides) if at != open_side)), np.zeros(3), np.full(3, 0.1), 0.6
    )
    ahead = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])[open_side]
    assert np.linalg.norm(found) == pytest.approx(0.6)
    assert found[:2] @ ahead > 0.7 * np.linalg.norm(found[:2])
    assert found[2] > 0.1


def test_a_wall_hides_what_is_behind_it_and_not_itself():
    one = sight((0.15, 0.0, np.pi / 2))
    points = np.array([[0.0, 0.0, 0.1], [0.139, 0.0, 0.1]])
    assert one.hidden(np.array([[1.0, 0.0, 0.1], [-1.0, 0.0, 0.1]]), points).tolist() == [1.0, 0.0]


def test_bodies_are_seen_at_all_states():
    things, tips = sight().seen(["ball"])
    assert things.tolist() == [[0.1, 0.0, 0.02], [-0.1, 0.0, 0.02]]
    assert tips.shape == (0, 3)
