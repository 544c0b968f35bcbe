"""The nearest places on a line of straight pieces."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from robots.polyline import nearest_feet

PLACES = arrays(np.float64, (4, 3), elements=st.floats(-1.0, 1.0, width=32))


@given(points=PLACES, point=arrays(np.float64, 3, elements=st.floats(-1.0, 1.0, width=32)))
def test_no_place_of_a_piece_is_nearer(points, point):
    shares, distances = nearest_feet(points, point)
    assert ((shares >= 0.0) & (shares <= 1.0)).all()
    for share in np.linspace(0.0, 1.0, 11):
        others = points[:-1] + share * np.diff(points, axis=0)
        assert (distances <= np.linalg.norm(others - point, axis=1) + 1e-6).all()
