"""Energy of tissue that is pressed, pulled and let go: nothing is lost that is not booked."""

import pytest

from tests.engines.fem.energy_book import JAW, LIFTED, Motion


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_the_energy_book_closes(friction):
    motion, most = Motion(100, friction, finer=2), 1e-3
    motion.go((-0.02, 0.0, 2e-3), JAW, seconds=0.06)
    motion.go((-0.015, 0.0, 2e-3), JAW, seconds=0.06)
    motion.go((-0.015, 0.0, 2e-3), JAW, seconds=0.02)
    lines, left = motion.left()
    assert abs(left) < most
    assert lines["elastic"] > 3e-4
    assert (lines["rubbed"] > 1e-4) == (friction > 0.0)
    motion.take()
    motion.go((-0.015, 0.0, 8e-3), LIFTED, seconds=0.06)
    motion.go((-0.015, 0.0, 8e-3), LIFTED, seconds=0.01)
    assert abs(motion.left()[1]) < most
    motion.let_go()
    motion.go((-0.015, 0.0, 8e-3), LIFTED, seconds=0.1)
    lines, left = motion.left()
    assert abs(left) < most
    assert lines["elastic"] < 0.1 * motion.largest
