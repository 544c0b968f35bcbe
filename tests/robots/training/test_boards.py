import numpy as np
import pytest

from robots.training.boards import BOARDS
from robots.training.dishes import DISH, DISHES, PIECE


@pytest.mark.parametrize("name", BOARDS)
def test_posts_stand_on_the_board_and_leave_room_for_rings(name):
    board = BOARDS[name]
    assert (np.abs(board.posts) + board.post_radius < np.array(board.size[:2]) / 2).all()
    assert board.ring.inradius > board.post_radius
    apart = np.linalg.norm(board.posts[:, None] - board.posts[None], axis=-1)
    np.fill_diagonal(apart, np.inf)
    assert apart.min() > board.ring.side  # rings on neighbouring posts never touch, whichever way they turn


@pytest.mark.parametrize("name", BOARDS)
def test_rings_start_on_the_left_and_belong_on_the_right(name):
    board = BOARDS[name]
    assert (board.posts[list(board.starts), 0] < 0).all()
    assert (board.posts[list(board.targets), 0] > 0).all()
    assert len(board.starts) <= len(board.targets)


def test_the_ring_of_the_challenge_has_the_outline_of_its_mesh():
    ring = BOARDS["icra2026"].ring
    assert ring.side == pytest.approx(16.9e-3, abs=0.1e-3)
    assert ring.side * 3**0.5 / 2 == pytest.approx(14.7e-3, abs=0.1e-3)
    assert 0.5e-3 < ring.mass < 1e-3


def test_no_tool_can_carry_a_ring_through_the_wall():
    board = BOARDS["icra2026"]
    assert board.wall is not None
    near = np.abs(board.posts[:, 0] - board.wall.centre[0]).min()
    assert near > board.ring.side
    assert board.wall.size[2] > board.post_height + board.ring.height


def test_pieces_fit_into_dishes_that_stand_apart():
    places = np.array(list(DISHES.values()))
    apart = np.linalg.norm(places[:, None] - places[None], axis=-1)[np.triu_indices(3, 1)]
    assert (apart > 2 * DISH.outer_radius).all()
    assert PIECE.size[2] < DISH.height
