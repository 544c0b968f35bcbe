"""Force against depth of a running session: values as they come, and the time in which none came."""

import numpy as np
import pytest

from webconsole.bond_history import BondHistory


def pressed(times):
    """Return a history of 10 mm pressed at 10 mm/s with 100 N/m, forces seen half a period after places."""
    history, half = BondHistory("x"), 0.5 * (times[1] - times[0])
    for time in times:
        place, force = (np.array([0.0, 0.0, 0.005 - 0.01 * t]) for t in (time, time + half))
        history.add_place(time, np.append(place, [0, 0, 0, 1]))
        history.add_force(time + half, np.maximum(0.0, -100.0 * force))
    return history


@pytest.mark.parametrize("period_s", [0.004, 0.016, 0.05])
def test_place_and_force_of_different_times_give_the_same_curve(period_s):
    (contact,) = pressed(np.arange(0.0, 1.5 + period_s / 4, period_s)).trace.contacts
    slope = np.polyfit(contact.depth, contact.force, 1)[0]
    assert slope == pytest.approx(100.0, rel=0.02)


def test_a_contact_that_began_unseen_is_left_out():
    assert pressed(np.arange(0.9, 1.5, 0.016)).trace.contacts == [], "the page was opened later"
    times = np.arange(0.0, 1.5, 0.016)
    assert pressed(times[(times < 0.3) | (times > 0.9)]).trace.contacts == []


def test_a_fast_session_has_no_gaps_and_a_long_one_no_end():
    history = BondHistory("x")
    for i in range(30_000):
        history.add_place(0.7 * i, np.zeros(3))
        history.add_force(0.7 * i, np.array([0.0, 0.0, float(i % 9 > 4)]))
    trace = history.trace
    assert not np.isnan(trace.force).any()
    assert 4000 < len(trace.times_s) <= 8192
    assert trace.times_s[-1] == pytest.approx(0.7 * 29_999)
