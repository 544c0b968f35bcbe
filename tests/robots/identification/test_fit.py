"""Identification gives back the dynamics that made the measurements."""

import numpy as np
import pytest

from robots.dvrk import drives, dynamics
from robots.dvrk.instruments import instrument
from robots.dvrk.own_dynamics import OwnDynamics
from robots.identification.arms import of_ecm, of_psm
from robots.identification.fit import fit
from robots.identification.linear_model import FrictionShape, LinearModel, pseudo_inertias
from robots.identification.result import own_dynamics
from robots.identification.signals import Measured, filter_signals
from schemas.errors import MotionError, RecordingError

TOOL = instrument("400006")
ARM = of_psm(TOOL)
MODEL = LinearModel(ARM)
CUTOFF, RATE = 6.0, 50.0


def another_arm(model=MODEL):
    """Return parameters of a body and losses unlike the published ones, that an arm can have."""
    random, truth = np.random.default_rng(1), model.nominal.copy()
    body = model.parts["body"]
    roots = np.linalg.cholesky(pseudo_inertias(truth[body]))
    factors = roots @ (np.tril(random.normal(0.0, 0.1, roots.shape)) + np.eye(4))
    truth[body] = (factors @ factors.swapaxes(1, 2))[:, *np.triu_indices(4)].ravel()
    losses = slice(body.stop, None)
    truth[losses] *= random.uniform(0.5, 2.0, truth[losses].shape)
    truth[model.parts["offset"]] += 0.02
    return truth


def motion(duration, seed, arm=ARM):
    """Return times and joint positions of a Fourier series within the limits."""
    lower, upper, speed = np.array([[joint.lower, joint.upper, joint.velocity] for joint in arm.joints]).T
    n = len(lower)
    random, time = np.random.default_rng(seed), np.arange(0.0, duration, 1.0 / RATE)
    orders = np.arange(1, 7)[:, None]
    waves = np.sin(2.0 * np.pi / 15.0 * orders * time + random.uniform(0.0, 6.28, (n, 6, 1)))
    shape = np.einsum("jk,jkt->jt", random.normal(size=(n, 6)), waves)
    shape /= np.abs(shape).max(axis=1, keepdims=True)
    fastest = np.abs(np.gradient(shape, 1.0 / RATE, axis=1)).max(axis=1)
    half = np.minimum(0.4 * (upper - lower), 0.9 * speed / fastest)
    return time, ((lower + upper) / 2.0 + half * shape.T)


def efforts(truth, q, model=MODEL):
    dq = np.gradient(q, 1.0 / RATE, axis=0)
    regressor, carried = model.regressor(q, dq, np.gradient(dq, 1.0 / RATE, axis=0))
    return regressor @ truth + carried


def recorded(model, truth, seed=3):
    time, q = motion(20.0, seed, model.arm)
    effort = efforts(truth, q, model)
    effort += 0.005 * effort.std(axis=0) * np.random.default_rng(seed).normal(size=effort.shape)
    return filter_signals(Measured(time, q, effort), CUTOFF, RATE)


@pytest.fixture(scope="module")
def found():
    """Return another arm's parameters, and what is found of them out of its noisy efforts."""
    random, truth = np.random.default_rng(2), another_arm()
    time, q = motion(30.0, seed=3)
    effort = efforts(truth, q)
    effort += 0.02 * effort.std(axis=0) * random.normal(size=effort.shape)
    return truth, fit([filter_signals(Measured(time, q, effort), CUTOFF, RATE)], ARM)


def test_what_is_told_is_within_two_percent(found):
    truth, result = found
    true = result.base.combination @ truth
    told = result.base_deviations < 0.005 * np.abs(true)
    assert told.sum() >= 12
    assert (np.abs(result.base.combination @ result.parameters / true - 1.0)[told] < 0.02).all()


def test_efforts_not_seen_are_predicted(found):
    truth, result = found
    _, q = motion(6.0, seed=4)
    true, predicted = efforts(truth, q), efforts(result.parameters, q)
    assert (np.std(predicted - true, axis=0) < 0.02 * np.sqrt(np.mean(true**2, axis=0))).all()
    assert (result.residual < 0.03).all()
    assert (result.published_residual > 0.1).all()


def test_the_file_holds_a_body_that_can_be(found, tmp_path):
    file = tmp_path / "psm.yaml"
    file.write_text(own_dynamics(found[1], CUTOFF, ["sim.csv"]).text(), "utf-8")
    own = OwnDynamics.load(file)
    assert list(own.joints) == list(MODEL.joints)
    assert own.fit["recordings"] == ["sim.csv"]
    file.write_text(file.read_text("utf-8").replace("mass: ", "mass: -", 1), "utf-8")
    with pytest.raises(MotionError, match=r"bodies\.yaw\.mass.*greater than 0"):
        OwnDynamics.load(file)


def test_the_regressor_is_the_inertia_matrix_and_keeps_the_energy():
    arm, random = dynamics.of_psm(TOOL), np.random.default_rng(0)
    q, dq, ddq = (random.normal(0.0, 0.3, (1, 6)) for _ in range(3))
    losses = MODEL.nominal.copy()
    losses[MODEL.parts["stiffness"].start :] = 0.0

    def effort(dq, ddq):
        regressor, carried = MODEL.regressor(q, dq, ddq)
        return (regressor @ losses + carried)[0]

    rest = np.zeros((1, 6))
    assert effort(rest, ddq) == pytest.approx(
        arm.inertia_matrix(q[0]) @ ddq[0] + arm.gravity(q[0]), abs=1e-12
    )
    h = 1e-5  # s; the power at constant velocity is what the kinetic energy grows by
    ahead, behind = (0.5 * dq[0] @ arm.inertia_matrix((q + way * h * dq)[0]) @ dq[0] for way in (1.0, -1.0))
    power = dq[0] @ (effort(dq, rest) - arm.gravity(q[0]))
    assert power == pytest.approx((ahead - behind) / (2.0 * h), abs=1e-7)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda m: m._replace(position=np.where(m.time[:, None] == m.time[7], np.nan, m.position)), "row 7"),
        (lambda m: Measured(*(values[:100] for values in m)), "too short"),
        (lambda m: m._replace(time=m.time[::-1]), "too short"),
        (lambda m: m._replace(time=np.where(m.time == m.time[9], m.time[8], m.time)), "row 9 is not after"),
        (lambda m: Measured(*(values[::5] for values in m)), "too few for a cut-off"),
    ],
)
def test_spoilt_recordings_are_refused(spoil, reason):
    time, q = motion(6.0, seed=5)
    with pytest.raises(RecordingError, match=reason):
        filter_signals(spoil(Measured(time, q, np.zeros_like(q))), CUTOFF, RATE)


def test_a_motion_that_excites_little_is_refused():
    time, q = motion(6.0, seed=6)
    q[:, 1:] = 0.1
    with pytest.raises(RecordingError, match="condition number"):
        fit([filter_signals(Measured(time, q, np.zeros_like(q)), CUTOFF, RATE)], ARM)


def test_the_jaw_is_a_joint_that_shares_the_discs_of_the_wrist():
    arm = of_psm(TOOL, jaw=True)
    model = LinearModel(arm)
    truth = another_arm(model)
    dry = model.parts["coulomb"].start + 3 + np.arange(7)
    assert not model.nominal[dry[4:]].any(), "no friction of the fingers is published"
    truth[dry[4:]] = 0.004, 0.006, 0.012
    found = fit([recorded(model, truth)], arm)
    assert found.parameters[dry] == pytest.approx(truth[dry], rel=0.1)
    assert (found.residual < 0.02).all()
    own = own_dynamics(found, CUTOFF, ["sim.csv"])
    assert own.joints["jaw"].armature == pytest.approx(found.parameters[model.parts["armature"]][-1])
    closed = dict(own.drives_of(drives.psm(TOOL)))
    assert closed["jaw_left"].armature == 2.0 * own.joints["jaw"].armature
    pairs = own.discs_of(drives.discs(TOOL))
    assert [pair.coulomb_friction for pair in pairs] == pytest.approx(found.parameters[dry])
    assert pairs[6].shares == {"jaw_left": 1.0, "jaw_right": 1.0}


def test_a_base_that_is_turned_is_identified_with_its_gravity():
    gravity = -9.81 * np.array([0.0, np.sin(0.5), np.cos(0.5)])
    model = LinearModel(ARM, gravity)
    samples = recorded(model, another_arm(model))
    assert (fit([samples], ARM, gravity=gravity).residual < 0.02).all()
    assert fit([samples], ARM).residual[2] > 0.05


def test_the_endoscope_arm_is_identified(monkeypatch):
    # it is too slow for a random motion to tell its inertia from its weight
    monkeypatch.setattr("robots.identification.fit.LARGEST_CONDITION", 1e7)
    arm = of_ecm()
    model = LinearModel(arm)
    found = fit([recorded(model, another_arm(model))], arm)
    assert (found.residual < [0.02, 0.02, 0.02, 0.1]).all()
    assert (found.published_residual > 0.1).any()
    own_dynamics(found, CUTOFF, ["sim.csv"])


@pytest.mark.long
def test_friction_that_is_larger_at_rest_is_found():
    shape = FrictionShape(
        np.full(7, 200.0), 0.03 * np.abs(MODEL.shares) @ [joint.velocity for joint in ARM.joints]
    )
    model = LinearModel(ARM, shape=shape)
    truth = another_arm(model)
    truth[model.parts["static"]] = 0.5 * truth[model.parts["coulomb"]]
    samples = recorded(model, truth)
    with_it, without = (fit([samples], ARM, stribeck=stribeck).residual for stribeck in (True, False))
    assert (with_it < 0.02).all()
    assert (with_it < 0.5 * without)[[0, 1, 3]].all()
