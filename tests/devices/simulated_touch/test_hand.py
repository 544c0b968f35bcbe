import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from devices.haptics.contact import ZERO
from devices.simulated_touch.hand import SimulatedHand

numbers = st.floats(-1.0, 1.0)


@given(
    st.floats(0.05, 1.0),
    st.floats(10.0, 2000.0),
    st.floats(0.0, 100.0),
    st.sampled_from([1e-3, 1e-2]),
    st.tuples(numbers, numbers, numbers),
)
def test_it_moves_as_the_differential_equation_says(
    mass: float, stiffness: float, damping: float, tick: float, start: tuple[float, float, float]
) -> None:
    """m x'' = k (u - x) + c (u' - x') + F for constant u, u' and F, as the exponential of its matrix has it;
    weak, critical and strong damping.
    """
    for c in (damping, 2.0 * (stiffness * mass) ** 0.5):
        hand = SimulatedHand(mass, stiffness, c, tick, start)
        exact = np.array([start, (0.0, 0.0, 0.0)])
        matrix = expm(tick * np.array([[0.0, 1.0], [-stiffness / mass, -c / mass]]))
        for force, target, velocity in (
            ((1.0, 0.0, -2.0), ZERO, ZERO),
            (ZERO, (0.1, -0.1, 0.3), (0.5, 0.0, -0.2)),
        ):
            hand.move(force, target, velocity)
            rest = np.array(
                [np.array(target) + (np.array(force) + c * np.array(velocity)) / stiffness, np.zeros(3)]
            )
            exact = rest + matrix @ (exact - rest)
        assert hand.position == pytest.approx(exact[0], rel=1e-7, abs=1e-9)
        assert hand.velocity == pytest.approx(exact[1], rel=1e-7, abs=1e-7)


def test_a_wall_sampled_too_seldom_makes_it_swing_and_one_within_the_rule_does_not() -> None:
    """Colgate and Schenkel: b > K T / 2. With 4 N s/m and 20 ms that is 400 N/m; exact motion shows it."""

    def swing(stiffness: float, hold: int) -> float:
        hand, force, heights = SimulatedHand(0.15, 200.0, 4.0, 1e-3, ZERO), 0.0, []
        for i in range(4000):
            if i % hold == 0:
                force = max(0.0, -stiffness * hand.position[2])
            hand.move((0.0, 0.0, force), (0.0, 0.0, -0.01), ZERO)
            heights.append(hand.position[2])
        return max(heights[-1000:]) - min(heights[-1000:])

    assert swing(350.0, 20) < 1e-4
    assert swing(1000.0, 20) > 4e-3
    assert swing(1000.0, 1) < 1e-6
