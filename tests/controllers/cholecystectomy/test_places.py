"""Places of clips and cut: as wanted, and beside clips that closed elsewhere."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.cholecystectomy.places import (
    CUFF,
    STAYS,
    choose_places,
    cut_window,
    free_place,
    further_place,
)

lengths = st.floats(8.3e-3, 45e-3)


@given(lengths)
def test_the_wanted_places_leave_room_for_the_cut(length):
    places = choose_places(length)
    window = cut_window(places.clips)
    assert window is not None
    assert window[0] - 1e-9 <= places.cut <= window[1] + 1e-9


def test_the_cut_goes_between_the_clips_as_they_lie():
    window = cut_window(np.array([14.7e-3, 9.1e-3, 5.5e-3]))  # the second clip lies 1.9 mm off
    assert window == pytest.approx((7.1e-3, 7.5e-3))
    assert cut_window(np.array([14.7e-3, 8.5e-3, 5.5e-3])) is None  # no room for two cuffs of 1 mm
    assert cut_window(np.array([14.7e-3, 5.5e-3])) is None  # one clip would stay


def test_a_further_clip_makes_room_for_a_cut():
    clips = np.array([14.7e-3, 8.0e-3, 5.5e-3])
    place = further_place(20.3e-3, clips)
    assert place is not None
    window = cut_window(np.append(clips, place))
    assert window == pytest.approx((8.0e-3 + CUFF, 14.7e-3 - CUFF))
    assert (np.append(clips, place) > window[1]).sum() == STAYS
    assert further_place(9e-3, np.array([7e-3, 4e-3, 2e-3])) is None


@given(lengths, st.lists(st.floats(0.0, 45e-3), max_size=5))
def test_a_free_place_keeps_its_distance_from_all_clips(length, clips):
    place = free_place(2e-3, length, np.array(clips))
    if place is not None:
        assert 2e-3 <= place < length
        assert all(abs(place - clip) >= 2e-3 for clip in clips)


def test_a_clip_that_closed_elsewhere_moves_the_next_ones():
    places = choose_places(20e-3)
    first, second, third = places.clips
    closed = np.full(3, -1.0)
    assert (places.beside(closed) == places.clips).all()
    closed[0] = second + 1e-3
    assert places.beside(closed)[1] == pytest.approx(second - 1e-3)
    closed[:2] = first, third + 1e-3
    assert places.beside(closed)[2] == pytest.approx(max(third + 1e-3 - 2 * CUFF, 1.5e-3))
