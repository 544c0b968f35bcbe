"""The promises of the chain, over whatever a bad day can bring: each is checked from outside, from what went
in and what came out.
"""

from copy import deepcopy
from functools import cache
from math import exp, hypot, inf, isfinite, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.haptics.contact import ZERO, Plane
from devices.haptics.limits import TOUCH, Limits
from devices.haptics.loop import HapticLoop
from devices.haptics.safety import Condition, SafetyChain
from devices.vendor_axes import Vector3

LIMITS = Limits().bound_by(TOUCH)
TICK = 0.001
STILL = (0.0, 0.0, 0.0)
WALL = Plane(0.0, 0.0, 1.0, 0.0, 0.0, 400.0, 0.0, 0.0)
"""Pushes up whatever is below z = 0."""

bad = st.sampled_from([nan, inf, -inf, 1e308, -1e308, 5e-324])
lengths = st.floats(-0.1, 0.1) | bad
positions = st.tuples(lengths, lengths, lengths) | st.tuples(*3 * [st.floats(-0.02, 0.02)])
velocities = st.tuples(*3 * [st.floats(-0.5, 0.5)]) | st.tuples(*3 * [st.floats(-3.0, 3.0) | bad])
angles = st.floats(-1.0, 1.0)
normals = (
    st.tuples(angles, angles, angles)
    .filter(lambda v: hypot(*v) > 0.01)
    .map(lambda v: (v[0] / hypot(*v), v[1] / hypot(*v), v[2] / hypot(*v)))
)
good_planes = st.builds(
    lambda n, *rest: Plane(*n, *rest),
    normals, st.floats(-0.05, 0.05), st.floats(-2.0, 2.0),
    st.floats(0.0, 1e6), st.floats(0.0, 1e3), st.floats(0.0, 3.0),
)  # fmt: skip
any_planes = st.builds(Plane, *8 * [st.floats(-2.0, 2.0) | bad])
models = st.tuples(
    st.lists(good_planes, max_size=5) | st.lists(any_planes | good_planes, max_size=4),
    st.integers(-3, 3),
    st.floats(0.0, 0.2) | bad,
)
"""Planes, how much newer the stamp is than the last one's, and how long ago (s) the model arrived."""
steps = st.sampled_from([TICK] * 12 + [0.0, 0.0003, 0.02, 0.06, 0.2, 5.0])
ticks = st.lists(
    st.tuples(steps, positions, velocities, st.sampled_from([True] * 9 + [False]), st.none() | models),
    min_size=1,
    max_size=60,
)


def _from_segment(point: Vector3, end: Vector3) -> float:
    """Return the distance of `point` from the segment between zero and `end`, found by a golden section."""
    low, high = 0.0, 1.0
    for _ in range(45):
        one, two = low + 0.382 * (high - low), low + 0.618 * (high - low)
        if hypot(*(p - one * e for p, e in zip(point, end, strict=True))) < hypot(
            *(p - two * e for p, e in zip(point, end, strict=True))
        ):
            high = two
        else:
            low = one
    return hypot(*(p - low * e for p, e in zip(point, end, strict=True)))


@cache
def _begun(passivity: bool, pressed: bool) -> HapticLoop:
    """A loop at 0 s: new, or with the largest force on and a model with the stamp 0 just arrived."""
    loop = HapticLoop(LIMITS, passivity=passivity)
    for i in range(-1500, 1) if pressed else ():
        loop.receive([WALL], i, i * TICK)
        loop.tick(i * TICK, (0.0, 0.0, 0.001 if i < -300 else -0.01), STILL, permitted=True)
    assert (hypot(*loop.force) == pytest.approx(LIMITS.force)) is pressed
    return loop


@given(ticks, st.booleans(), st.booleans())
def test_whatever_comes_every_limit_holds(ticks: list, passivity: bool, pressed: bool) -> None:
    loop = deepcopy(_begun(passivity, pressed))
    now, stamp, arrived, last, off_until, locked = (
        0.0,
        0,
        0.0 if pressed else -inf,
        loop.force,
        -inf if pressed else 0.0,
        False,
    )
    for dt, position, velocity, permitted, model in ticks:
        now += dt
        if model is not None:
            planes, newer, ago = model
            if loop.receive(planes, stamp + newer, now - ago):
                assert all(isfinite(x) for plane in planes for x in plane)
                assert newer > 0 or not now - ago - arrived <= LIMITS.silence
                stamp, arrived = stamp + newer, now - ago
        force = loop.tick(now, position, velocity, permitted=permitted)

        assert hypot(*force) <= LIMITS.force * (1 + 1e-12)
        assert hypot(*force) <= hypot(*last) + LIMITS.slew + 1e-12
        assert _from_segment(force, last) <= LIMITS.slew + 1e-7
        silent = not -0.01 < now - arrived <= LIMITS.silence
        too_fast = hypot(*velocity) > LIMITS.speed
        locked = permitted and (locked or (too_fast and not silent and isfinite(hypot(*velocity))))
        if not permitted or silent or too_fast or locked or not all(map(isfinite, velocity)):
            assert force == ZERO
            off_until = now
        assert hypot(*force) <= LIMITS.force * min(1.0, (now - off_until) / LIMITS.ramp) + 1e-12
        last = force


def _run(
    loop: HapticLoop,
    ticks: int,
    position: Vector3 = STILL,
    *,
    start: float,
    planes: list[Plane] | None = None,
    **kinds: bool,
) -> list[Vector3]:
    """Tick at 1 kHz; with `planes`, a model comes at every fourth tick."""
    forces: list[Vector3] = []
    for i in range(ticks):
        now = start + i * TICK
        if planes is not None and i % 4 == 0:
            loop.receive(planes, round(now * 1e9), now)
        forces.append(loop.tick(now, position, STILL, permitted=kinds.get("permitted", True)))
    return forces


def _pressed() -> HapticLoop:
    """A loop that has been ramped in at 0 s to 1.1 s and gives 2 N x 0.98 at 2 s."""
    loop = HapticLoop(LIMITS)
    _run(loop, 1100, (0, 0, 0.001), start=0.0, planes=[WALL])
    _run(loop, 900, (0, 0, -0.05), start=1.1, planes=[WALL])
    assert loop.force == pytest.approx((0, 0, 0.6 * 3.3))
    return loop


def test_silence_lets_the_force_decay_and_end_within_130_ms() -> None:
    loop = _pressed()
    forces = _run(loop, 200, (0, 0, -0.05), start=2.0)
    age = [0.004 + i * TICK for i in range(200)]  # the newest model came at 1.996 s
    assert forces[0][2] == pytest.approx(1.98)
    for a, force in zip(age, forces, strict=True):
        if a < 0.0995:
            assert force[2] == pytest.approx(1.98)
        elif a < 0.1285:
            assert force[2] == pytest.approx(1.98 * exp(-(a - 0.1) / 0.02), rel=1e-6)
        elif a > 0.1295:
            assert force == ZERO
    assert loop.condition is Condition.SILENT


def test_after_silence_the_force_waits_for_the_hand_and_ramps() -> None:
    loop = _pressed()
    _run(loop, 200, (0, 0, -0.05), start=2.0)
    assert set(_run(loop, 500, (0, 0, -0.05), start=2.2, planes=[WALL])) == {ZERO}
    assert loop.condition is Condition.WAITING
    _run(loop, 5, (0, 0, -0.0004), start=2.7, planes=[WALL])  # 0.16 N
    assert loop.condition is Condition.ON
    forces = _run(loop, 1100, (0, 0, -0.05), start=2.705, planes=[WALL])
    assert forces[499][2] == pytest.approx(0.5 * 1.98, rel=0.01)
    assert forces[-1][2] == pytest.approx(1.98)
    assert all(f[2] <= 1.98 * (i + 2) * TICK + 1e-9 for i, f in enumerate(forces))


def test_a_short_silence_only_fades() -> None:
    loop = _pressed()
    forces = _run(loop, 120, (0, 0, -0.05), start=2.0)
    assert 0 < forces[-1][2] < 0.7
    back = _run(loop, 100, (0, 0, -0.05), start=2.12, planes=[WALL])
    # on from where it was, by the ramp
    assert forces[-1][2] <= back[0][2] <= back[-1][2] <= forces[-1][2] + 0.1 * 1.98 + 0.01


def test_the_dead_man_takes_the_force_away_at_once() -> None:
    loop = _pressed()
    assert _run(loop, 1, (0, 0, -0.05), start=2.0, planes=[WALL], permitted=False) == [ZERO]
    assert set(_run(loop, 100, (0, 0, -0.05), start=2.001, planes=[WALL])) == {ZERO}


def test_a_hand_too_fast_gets_no_force_until_it_lets_go() -> None:
    loop = _pressed()
    assert loop.tick(2.0, (0, 0, -0.05), (0, 0, -1.01), permitted=True) == ZERO
    assert set(_run(loop, 100, (0, 0, 0.001), start=2.001, planes=[WALL])) == {ZERO}
    assert loop.condition is Condition.TOO_FAST
    _run(loop, 1, (0, 0, 0.001), start=2.101, planes=[WALL], permitted=False)
    _run(loop, 5, (0, 0, 0.001), start=2.102, planes=[WALL])
    assert loop.condition is Condition.ON


def test_taking_up_an_instrument_that_presses_already_gives_no_kick() -> None:
    loop = HapticLoop(LIMITS)
    # the dead-man is held, and the arm does not follow yet
    _run(loop, 1500, (0, 0, -0.05), start=0.0, planes=[])
    forces = _run(loop, 1000, (0, 0, -0.05), start=1.5, planes=[WALL])
    assert [force[2] for force in forces[:3]] == pytest.approx([0.1, 0.2, 0.2], abs=0.01)
    assert forces[449][2] == pytest.approx((0.2 + 1.98 * 0.45), rel=0.01)
    assert forces[-1][2] == pytest.approx(1.98)
    _run(loop, 20, (0, 0, 0.001), start=2.5, planes=[])
    # a light touch is there at once
    assert _run(loop, 20, (0, 0, -0.0004), start=2.52, planes=[WALL])[-1][2] == pytest.approx(0.16)


def test_another_session_starts_at_time_zero() -> None:
    loop = HapticLoop(LIMITS)
    assert loop.receive([WALL], 10**12, 1.0)
    assert not loop.receive([], 5, 1.1)
    assert not loop.receive([], 10**12, 1.1)
    assert loop.receive([WALL], 0, 1.2)
    assert loop.receive([WALL], 1, 1.201)


def test_a_bad_model_is_as_if_it_had_never_come() -> None:
    loop = _pressed()
    for i in range(200):
        assert not loop.receive([WALL._replace(distance=nan)], 10**12 + i, 2.0 + i * TICK)
        force = loop.tick(2.0 + i * TICK, (0, 0, -0.05), STILL, permitted=True)
    assert force == ZERO


def test_reset_takes_the_force_and_the_contact() -> None:
    loop = _pressed()
    loop.reset()
    assert loop.force == ZERO
    assert _run(loop, 10, (0, 0, -0.05), start=2.0) == [ZERO] * 10
    assert loop.condition is Condition.SILENT


def test_the_same_ticks_give_the_same_bits() -> None:
    one, other = HapticLoop(LIMITS, passivity=True), HapticLoop(LIMITS, passivity=True)
    planes = [Plane(0.6, 0.0, 0.8, 0.01, 0.02, 300.0, 1.0, 0.4), WALL]
    assert _run(one, 1500, (0.001, 0, -0.002), start=0.0, planes=planes) == _run(
        other, 1500, (0.001, 0, -0.002), start=0.0, planes=planes
    )


def _engaged() -> SafetyChain:
    """A chain whose ramp is over, with no force."""
    chain = SafetyChain(LIMITS)
    for _ in range(1100):
        chain.tick(ZERO, STILL, age=0.0, permitted=True, dt=TICK)
    return chain


def _next(chain: SafetyChain, *wanted: float) -> Vector3:
    return chain.tick((wanted[0], wanted[1], wanted[2]), STILL, age=0.0, permitted=True, dt=TICK)


def test_a_force_grows_slowly_and_falls_at_once() -> None:
    chain = _engaged()
    grown = [_next(chain, 0, 0, 1.5)[2] for _ in range(16)]
    assert grown == pytest.approx([min(1.5, 0.1 * (i + 1)) for i in range(16)])
    assert _next(chain, 0, 0, 0.3) == pytest.approx((0, 0, 0.3))


def test_a_force_turns_slowly() -> None:
    chain = _engaged()
    for _ in range(16):
        _next(chain, 0, 0, 1.5)
    assert _next(chain, 0.05, 0, 1.5) == pytest.approx((0.05, 0, 1.5))
    # the old direction at once, the new one from there
    assert _next(chain, 1.5, 0, 0) == pytest.approx((0.1, 0, 0), abs=0.05)
    assert _next(chain, -1.5, 0, 0) == pytest.approx((-0.1, 0, 0), abs=0.05)
