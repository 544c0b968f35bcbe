import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.dvrk import arm_bodies, drives, dynamics, identified
from robots.dvrk.inertia import Inertia
from robots.dvrk.instruments import instrument, instruments
from schemas.errors import MotionError

REFERENCE = json.loads((Path(__file__).parent / "data" / "reference_dynamics.json").read_text())
CASES = pytest.mark.parametrize("case", REFERENCE["cases"], ids=lambda case: str(case["q"]))
NEEDLE_DRIVER = instrument("LARGE_NEEDLE_DRIVER_400006")
PSM, ECM = dynamics.of_psm(NEEDLE_DRIVER), dynamics.of_ecm()

ANGLE = st.floats(-0.9, 0.9)
POSITIONS = st.tuples(ANGLE, ANGLE, st.floats(0.0, 0.24), ANGLE, ANGLE, ANGLE).map(np.array)


@CASES
def test_the_combined_terms_are_those_of_the_identified_model(case):
    q = np.array(case["q"])
    assert np.allclose(identified.inertia_matrix(q), case["inertia"], rtol=0.0, atol=2e-9)
    assert np.allclose(identified.gravity(q), case["gravity"], rtol=0.0, atol=2e-9)
    if "elastic" in case:
        assert np.allclose(identified.elastic_torque(q), case["elastic"], rtol=0.0, atol=2e-9)


@CASES
@pytest.mark.parametrize(
    "tool", ["LARGE_NEEDLE_DRIVER_400006", "LARGE_NEEDLE_DRIVER_420006", "PROGRASP_FORCEPS_400093"]
)
def test_the_bodies_have_the_identified_dynamics(case, tool):
    psm, q = dynamics.of_psm(instrument(tool)), np.array(case["q"])
    assert np.allclose(
        psm.inertia_matrix(q)[:3, :3], case["inertia"], rtol=0.0, atol=0.05 * np.max(case["inertia"])
    )
    assert np.allclose(
        psm.gravity(q)[:3], case["gravity"], rtol=0.0, atol=0.05 * np.max(np.abs(case["gravity"]))
    )


def test_the_bodies_fit_better_than_asked():
    errors = [
        np.abs(PSM.inertia_matrix(np.array(case["q"]))[:3, :3] - case["inertia"]).max()
        for case in REFERENCE["cases"]
    ]
    assert max(errors) < 0.02 * 0.4167
    errors = [
        np.abs(PSM.gravity(np.array(case["q"]))[:3] - case["gravity"]).max() for case in REFERENCE["cases"]
    ]
    assert max(errors) < 1e-3


@pytest.mark.parametrize("tool", [name for name in instruments() if "GEARED" not in name])
def test_every_body_is_one_that_can_be(tool):
    for name, body in {**arm_bodies.psm(instrument(tool)), **arm_bodies.ecm()}.items():
        moments = np.linalg.eigvalsh(body.tensor)
        assert body.mass > 0.0, name
        assert moments[0] > 0.0, name
        assert moments[2] < moments[0] + moments[1], name
        assert np.linalg.eigvalsh(body.pseudo_inertia)[0] > 0.0, name


def test_a_needle_driver_moves_as_much_mass_as_was_identified():
    masses = {name: body.mass for name, body in arm_bodies.psm(NEEDLE_DRIVER).items()}
    moving = sum(
        masses[name] for name in ("insertion", "roll", "wrist_pitch", "wrist_yaw", "jaw_left", "jaw_right")
    )
    assert moving == pytest.approx(identified.INSERTION_MASS, rel=2e-3)
    assert masses["counterweight"] == pytest.approx(identified.COUNTERWEIGHT_MASS, rel=2e-3)


def test_friction_is_that_of_the_identified_model():
    *dq, jaw = REFERENCE["friction"]["dq"]
    velocities = {
        **dict(zip((joint.name for joint in dynamics.psm.chain(NEEDLE_DRIVER).joints), dq, strict=True)),
        "jaw_left": jaw / 2,
        "jaw_right": jaw / 2,
    }
    found = drives.friction(drives.psm(NEEDLE_DRIVER), velocities, drives.discs(NEEDLE_DRIVER))
    assert np.allclose(
        [*list(found.values())[:6], found["jaw_left"]], REFERENCE["friction"]["effort"], rtol=0.0, atol=2e-5
    )
    assert found["jaw_left"] == found["jaw_right"]


def test_elasticity_is_that_of_the_identified_model():
    q = np.array([0.3, -0.2, 0.15, 0.5])
    found = [
        drive.elasticity * x + drive.offset
        for drive, x in zip(list(drives.psm(NEEDLE_DRIVER).values())[:4], q, strict=True)
    ]
    assert np.allclose(found, identified.elastic_torque(q), rtol=0.0, atol=1e-9)


@given(POSITIONS, st.integers(0, 5), st.tuples(*[st.floats(-9.81, 9.81)] * 3).map(np.array))
def test_gravity_is_the_slope_of_one_potential(q, i, pull):
    """The derivative of gravity by q is symmetric, as it has a potential, for a base of any orientation."""
    step, slope = 1e-6, np.empty((6, 6))
    for j in range(6):
        ahead, behind = q.copy(), q.copy()
        ahead[j] += step
        behind[j] -= step
        slope[j] = (PSM.gravity(ahead, pull) - PSM.gravity(behind, pull)) / (2 * step)
    assert np.allclose(slope[i], slope[:, i], atol=1e-7)


@given(POSITIONS)
def test_the_inertia_matrix_is_positive_definite(q):
    assert np.linalg.eigvalsh(PSM.inertia_matrix(q))[0] > 0.0
    assert np.linalg.eigvalsh(ECM.inertia_matrix(q[:4]))[0] > 0.0


def test_a_rod_and_a_box_weigh_what_they_should():
    rod = Inertia.of_rod(2.0, np.zeros(3), np.array([0.0, 3.0, 0.0]), 0.1)
    assert np.allclose(np.diag(rod.tensor), [2 * (9 / 12 + 0.005), 2 * 0.01, 2 * (9 / 12 + 0.005)])
    box = Inertia.of_box(12.0, np.ones(3), np.array([1.0, 2.0, 3.0]))
    assert np.allclose(np.diag(box.tensor), [13.0, 10.0, 5.0])


@pytest.mark.parametrize("tool", [name for name in instruments() if "GEARED" not in name])
def test_every_instrument_has_drives_for_all_it_moves(tool):
    tool = instrument(tool)
    found = drives.psm(tool)
    motors = {motor.name for motor in tool.end_effector.motors}
    assert set(found) == {"yaw", "pitch", "insertion", *(joint.name for joint in tool.joints), *motors}
    assert all(
        drive.stiffness > 0 and drive.damping > 0 and drive.effort > 0 and drive.velocity > 0
        for drive in found.values()
    )
    assert all(set(disc.shares) <= set(found) for disc in drives.discs(tool))


@pytest.mark.parametrize(
    ("q", "reason"), [(np.zeros(5), "expected 6: yaw"), (np.full(6, np.nan), "not all positions are finite")]
)
def test_there_are_no_dynamics_of_what_is_no_configuration(q, reason):
    for ask in (PSM.inertia_matrix, PSM.gravity):
        with pytest.raises(MotionError, match=reason):
            ask(q)
