from math import hypot

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.haptics.contact import ZERO
from devices.haptics.passivity import Passivity
from devices.simulated_touch.hand import SimulatedHand
from devices.vendor_axes import Vector3

TICK = 0.001
forces = st.tuples(*3 * [st.floats(-3.0, 3.0)]) | st.just(ZERO)
velocities = st.tuples(*3 * [st.floats(-0.3, 0.3)]) | st.just(ZERO)


@given(st.lists(st.tuples(forces, velocities, st.sampled_from([TICK, 0.0002, 0.02])), max_size=40))
def test_with_enough_damping_the_hand_never_gets_more_than_it_gave(
    ticks: list[tuple[Vector3, Vector3, float]],
) -> None:
    watch = Passivity(damping=1e12)
    position, energy = np.zeros(3), 0.0
    for wanted, velocity, dt in ticks:
        force = watch.correct(wanted, tuple(position.tolist()), velocity, dt)
        watch.remember_force(force)
        step = np.array(velocity) * dt
        position += step
        energy = energy - float(np.dot(force, step)) if any(force) else 0.0
        assert energy >= -1e-9


@given(forces, velocities, st.floats(0.0, 10.0))
def test_it_only_ever_brakes(wanted: Vector3, velocity: Vector3, damping: float) -> None:
    watch = Passivity(damping)
    watch.remember_force((0.0, 0.0, 1.0))
    change = np.subtract(watch.correct(wanted, (0.0, 0.0, 0.001), velocity, TICK), wanted)
    assert np.linalg.norm(change) <= damping * hypot(*velocity) + 1e-12
    assert np.dot(change, velocity) <= 0.0


def test_what_one_contact_dissipated_does_not_pay_for_the_next() -> None:
    watch = Passivity(4.0)
    watch.remember_force((0.0, 0.0, 2.0))
    watch.correct((0.0, 0.0, 2.0), (0.0, 0.0, -0.01), ZERO, TICK)
    assert watch.energy == pytest.approx(0.02)
    watch.remember_force(ZERO)
    watch.correct(ZERO, (0.0, 0.0, -0.01), ZERO, TICK)
    assert watch.energy == 0.0


def _swing(watch: Passivity | None) -> float:
    """Return the hand's motion, peak to peak, in the last of three seconds at a wall of 1 kN/m that is
    sampled at 50 Hz: too seldom by far.
    """
    hand = SimulatedHand(0.15, 200.0, 4.0, TICK, (0.0, 0.0, 0.01))
    heights: list[float] = []
    held = 0.0
    for i in range(3000):
        if i % 20 == 0:
            held = max(0.0, -1000.0 * hand.position[2])
        force: Vector3 = (0.0, 0.0, held)
        if watch is not None:
            force = watch.correct(force, hand.position, hand.velocity, TICK)
            watch.remember_force(force)
        hand.move(force, (0.0, 0.0, -0.005), ZERO)
        heights.append(hand.position[2])
    return max(heights[-1000:]) - min(heights[-1000:])


def test_a_wall_that_swings_is_calmed() -> None:
    free, watched = _swing(None), _swing(Passivity(4.0))
    assert free > 0.005
    assert watched < 0.2 * free
