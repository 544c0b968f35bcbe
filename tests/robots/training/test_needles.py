import numpy as np
import pytest

from robots.training.needles import DEFAULT, NEEDLES


@pytest.mark.parametrize("name", NEEDLES)
def test_marks_lie_on_the_wire_from_base_to_tip(name):
    needle = NEEDLES[name]
    assert np.allclose(np.linalg.norm(needle.marks, axis=1), needle.radius)
    angles = np.arctan2(needle.marks[:, 1], needle.marks[:, 0])
    turns = np.unwrap(angles)  # half a turn from base to tip is the same either way
    assert (np.diff(turns) > 0.0).all() or needle.arc > np.pi
    assert needle.angle(0.0) == pytest.approx(needle.arc / 2.0)
    assert needle.angle(needle.length) == pytest.approx(-needle.arc / 2.0)
    for mark, frame in zip(needle.marks, needle.frames.values(), strict=True):
        assert np.allclose(frame[:3, 3], mark)
        assert np.allclose(frame[:3, :3] @ frame[:3, :3].T, np.eye(3))


def test_needles_have_the_measures_of_their_sources():
    assert NEEDLES["sh"].length == pytest.approx(26e-3)
    assert NEEDLES[DEFAULT].radius == pytest.approx(11.44e-3)
    src = NEEDLES["src"]
    assert src.radius == pytest.approx(9.39e-3, abs=5e-6)
    assert np.degrees(src.arc) == pytest.approx(132.5, abs=0.05)
    base, mid, tip = src.marks
    assert np.linalg.norm(tip - base) == pytest.approx(17.19e-3, abs=5e-6)
    there = np.array([[-9.513e-3, 1.026e-3], [-4.099e-3, 8.965e-3], [6.618e-3, 6.973e-3]])
    assert np.linalg.norm(mid - base) == pytest.approx(np.linalg.norm(there[1] - there[0]))
    assert np.linalg.norm(mid - tip) == pytest.approx(np.linalg.norm(there[1] - there[2]))


@pytest.mark.parametrize("name", NEEDLES)
def test_what_is_bonded_is_half_way_where_the_rules_frame_need_not_be(name):
    needle = NEEDLES[name]
    assert needle.bond_points[[0, 2]] == pytest.approx(needle.marks[[0, 2]])
    assert needle.bond_points[1] == pytest.approx([needle.radius, 0.0, 0.0])
