"""Identification gives back the dynamics that made the measurements."""

import numpy as np
import pytest

from robots.dvrk import psm
from robots.dvrk.dynamics import of_psm
from robots.dvrk.instruments import instrument
from robots.dvrk.own_dynamics import OwnDynamics
from robots.identification.fit import fit
from robots.identification.linear_model import LinearModel, pseudo_inertias
from robots.identification.result import own_dynamics
from robots.identification.signals import Measured, filtered
from schemas.errors import MotionError, RecordingError

TOOL = instrument("400006")
MODEL = LinearModel(TOOL)
LOWER, UPPER, SPEED = np.array(
    [[joint.lower, joint.upper, joint.velocity] for joint in psm.chain(TOOL).joints]
).T
CUTOFF, RATE = 6.0, 50.0


def another_arm():
    """Return parameters of a body and losses unlike the published ones, that an arm can have."""
    random, truth = np.random.default_rng(1), MODEL.nominal.copy()
    body = MODEL.parts["body"]
    roots = np.linalg.cholesky(pseudo_inertias(truth[body]))
    factors = roots @ (np.tril(random.normal(0.0, 0.1, roots.shape)) + np.eye(4))
    truth[body] = (factors @ factors.swapaxes(1, 2))[:, *np.triu_indices(4)].ravel()
    losses = slice(body.stop, None)
    truth[losses] *= random.uniform(0.5, 2.0, truth[losses].shape)
    truth[MODEL.parts["offset"]] += 0.02
    return truth


def motion(duration, seed):
    """Return times and joint positions of a Fourier series within the limits."""
    random, time = np.random.default_rng(seed), np.arange(0.0, duration, 1.0 / RATE)
    orders = np.arange(1, 7)[:, None]
    waves = np.sin(2.0 * np.pi / 15.0 * orders * time + random.uniform(0.0, 6.28, (6, 6, 1)))
    shape = np.einsum("jk,jkt->jt", random.normal(size=(6, 6)), waves)
    shape /= np.abs(shape).max(axis=1, keepdims=True)
    speed = np.abs(np.gradient(shape, 1.0 / RATE, axis=1)).max(axis=1)
    half = np.minimum(0.4 * (UPPER - LOWER), 0.9 * SPEED / speed)
    return time, ((LOWER + UPPER) / 2.0 + half * shape.T)


def efforts(truth, q):
    dq = np.gradient(q, 1.0 / RATE, axis=0)
    state = q, dq, np.gradient(dq, 1.0 / RATE, axis=0)
    return MODEL.regressor(*state) @ truth + MODEL.carried(*state)


@pytest.fixture(scope="module")
def found():
    """Return another arm's parameters, and what is found of them out of its noisy efforts."""
    random, truth = np.random.default_rng(2), another_arm()
    time, q = motion(30.0, seed=3)
    effort = efforts(truth, q)
    effort += 0.02 * effort.std(axis=0) * random.normal(size=effort.shape)
    return truth, fit([filtered(Measured(time, q, effort), CUTOFF, RATE)], TOOL)


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
    file.write_text(own_dynamics(found[1], TOOL, CUTOFF, ["sim.csv"]).text(), "utf-8")
    own = OwnDynamics.load(file)
    assert list(own.joints) == list(MODEL.joints)
    assert own.fit["recordings"] == ["sim.csv"]
    file.write_text(file.read_text("utf-8").replace("mass: ", "mass: -", 1), "utf-8")
    with pytest.raises(MotionError, match=r"bodies\.yaw\.mass.*greater than 0"):
        OwnDynamics.load(file)


def test_the_regressor_is_the_inertia_matrix_and_keeps_the_energy():
    arm, random = of_psm(TOOL), np.random.default_rng(0)
    q, dq, ddq = (random.normal(0.0, 0.3, (1, 6)) for _ in range(3))
    losses = MODEL.nominal.copy()
    losses[MODEL.parts["stiffness"].start :] = 0.0

    def effort(dq, ddq):
        return (MODEL.regressor(q, dq, ddq) @ losses + MODEL.carried(q, dq, ddq))[0]

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
        filtered(spoil(Measured(time, q, np.zeros_like(q))), CUTOFF, RATE)


def test_a_motion_that_excites_little_is_refused():
    time, q = motion(6.0, seed=6)
    q[:, 1:] = 0.1
    with pytest.raises(RecordingError, match="condition number"):
        fit([filtered(Measured(time, q, np.zeros_like(q)), CUTOFF, RATE)], TOOL)
