"""States of several arms are computed together; each has the bits that it has alone."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.controllers.motion.rig import CART, Rig

STATES = (
    "measured_js",
    "setpoint_js",
    "local/measured_cp",
    "local/setpoint_cp",
    "local/measured_cv",
    "body/jacobian",
    "spatial/jacobian",
    "body/measured_cf",
    "spatial/measured_cf",
)


def put(rig, arm, seed):
    """Put an arm anywhere near its setpoint, with any velocities and efforts."""
    rig.follows = False
    value = rig.sensed[f"sense/{arm}/measured_js"]
    value += np.random.default_rng(seed).uniform(-0.03, 0.03, value.size)


@given(st.integers(0, 2**32), st.sampled_from(sorted(CART)))
def test_an_arm_has_the_same_states_alone_and_among_others(seed, arm):
    among, alone = Rig(CART, publish_period="1 ms"), Rig({arm: CART[arm]}, publish_period="1 ms")
    for i, name in enumerate(CART):
        put(among, name, seed if name == arm else seed + 1 + i)
    put(alone, arm, seed)
    among.step()
    alone.step()
    for state in STATES:
        assert among.outputs[f"{arm}/{state}"].tobytes() == alone.outputs[f"{arm}/{state}"].tobytes()
    before = {state: among.outputs[f"{arm}/{state}"].copy() for state in STATES}
    put(among, next(name for name in CART if name != arm), seed)
    among.step()
    assert all((among.outputs[f"{arm}/{state}"] == value).all() for state, value in before.items())


@pytest.mark.parametrize("kind", ["body", "spatial"])
@pytest.mark.parametrize(("arm", "stretched"), [("PSM1", False), ("PSM1", True), ("ECM", False)])
def test_the_wrench_is_that_of_the_pseudo_inverse_also_where_the_jacobian_is_singular(arm, stretched, kind):
    rig = Rig(CART, publish_period="1 ms")
    put(rig, arm, 1)
    measured = rig.sensed[f"sense/{arm}/measured_js"]
    if stretched:  # the wrist yaw axis passes the remote centre of motion
        measured[:6] = 0.3, -0.2, 0.4318 - 0.4162 - 0.0091, 0.5, 0.0, 0.25
    rig.step()
    n = measured.size // 3
    jacobian = rig.outputs[f"{arm}/{kind}/jacobian"].reshape(6, n)
    inverse = np.linalg.pinv(jacobian.T, rcond=1e-6)
    wrench = rig.outputs[f"{arm}/{kind}/measured_cf"]
    assert np.allclose(wrench, inverse @ measured[2 * n :], rtol=1e-12, atol=0.0)


def test_wrenches_that_nobody_uses_wait_until_somebody_does():
    always, seldom = Rig(CART, publish_period="1 ms"), Rig(CART, publish_period="1 ms")
    wrenches = frozenset(
        f"{arm}/{state}"
        for arm in CART
        for kind in ("body", "spatial")
        for state in (f"{kind}/jacobian", f"{kind}/measured_cf", "gravity_compensation/setpoint_js")
    )
    waits, differs = (frozenset[str](), wrenches, wrenches, frozenset({"ECM/body/jacobian"})), []
    for seed, unread in enumerate(waits):
        seldom.motion.unread = unread
        for rig in (always, seldom):
            put(rig, "PSM2", seed)
            rig.step()
        differs.append(
            {n for n, value in always.outputs.items() if not np.array_equal(value, seldom.outputs[n])}
        )
        assert always.motion.state_hash() == seldom.motion.state_hash()
    assert [not names for names in differs] == [True, False, False, True]
    assert set.union(*differs) <= wrenches
