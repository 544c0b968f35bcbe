"""Identified dynamics against the truth, and on recordings of real arms.

    python bench/identification.py
    python bench/identification.py --train one_results.csv --test two_results.csv

Without files: an arm unlike the published one (bodies changed at random by a tenth, losses by factors of 0.5
to 2), its efforts with noise of 5 percent; and the simulated arm in `configs/identify.yaml`. With two files
of WPI-AIM/dvrk_dynamics_identification (data/psm/measured_trajectory, whose residuals main_psm.ipynb prints;
no licence is stated, so none is here), or two CSV files as `trocar identify` reads them: fitted on one and
judged on the other.

Results: docs/decisions/0094-excitation.md. Only the times depend on the machine.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

from hub.hosting.numerics import pin_numerics

pin_numerics(os.environ)  # before numpy: the search for a motion magnifies the last bit

# ruff: noqa: E402
import numpy as np

import trocar
from learning.identification.measurements import measurements
from robots.dvrk.instruments import instrument
from robots.identification.arms import IdentifiedArm, of_psm
from robots.identification.excitation import excitation
from robots.identification.fit import Fit, fit, relative_residual
from robots.identification.linear_model import LinearModel, pseudo_inertias
from robots.identification.signals import Measured, Samples, filter_signals
from schemas.vectors import Vector

TOOL = instrument("400006")
CUTOFF, RATE = 6.0, 200.0
MATTERS = 0.05
"""Share of a joint's effort from which a base parameter matters."""
WPI = np.array([0.09, 0.18, 0.19, 0.13, 0.24, 0.21, 0.26])
"""Residual of that repository's own fit on the first period of `two`: joints 1 to 4, then motors 5 to 7."""
WPI_PERIOD = 1.0 / 0.18
"""Period of that repository's trajectories, s."""
MOTOR_TO_JOINT = np.array([[1.0186, 0.0, 0.0], [-0.8306, 0.6089, 0.6089], [0.0, -1.2177, 1.2177]])
"""Wrist pitch, wrist yaw and jaw of the last three motors."""


def another_arm(model: LinearModel) -> Vector:
    """Return parameters unlike the published ones, that an arm can have, shape (P,)."""
    random, truth = np.random.default_rng(1), model.nominal.copy()
    body = model.parts["body"]
    roots = np.linalg.cholesky(pseudo_inertias(truth[body]))
    factors = roots @ (np.tril(random.normal(0.0, 0.1, roots.shape)) + np.eye(4))
    truth[body] = (factors @ factors.swapaxes(1, 2))[:, *np.triu_indices(4)].ravel()
    losses = slice(body.stop, None)
    truth[losses] *= random.uniform(0.5, 2.0, truth[losses].shape)
    truth[model.parts["offset"]] += 0.02
    return truth


def random_motion(arm: IdentifiedArm, duration: float, seed: int) -> tuple[Vector, Vector]:
    """Return times and joint positions of Fourier series with random coefficients, as in decision 78."""
    random, time = np.random.default_rng(seed), np.arange(0.0, duration, 1.0 / RATE)
    lower, upper, speed = np.array([[joint.lower, joint.upper, joint.velocity] for joint in arm.joints]).T
    n, orders = len(lower), np.arange(1, 7)[:, None]
    waves = np.sin(2.0 * np.pi / 15.0 * orders * time + random.uniform(0.0, 6.28, (n, 6, 1)))
    shape = np.einsum("jk,jkt->jt", random.normal(size=(n, 6)), waves)
    shape /= np.abs(shape).max(axis=1, keepdims=True)
    fastest = np.abs(np.gradient(shape, 1.0 / RATE, axis=1)).max(axis=1)
    half = np.minimum(0.4 * (upper - lower), 0.9 * speed / fastest)
    return time, (lower + upper) / 2.0 + half * shape.T


def noisy(model: LinearModel, truth: Vector, time: Vector, q: Vector, noise: float) -> Samples:
    """Return what is recorded of `q`: efforts with a share of noise, positions with 1e-5 rad and m."""
    random = np.random.default_rng(2)
    dq = np.gradient(q, 1.0 / RATE, axis=0)
    regressor, carried = model.regressor(q, dq, np.gradient(dq, 1.0 / RATE, axis=0))
    effort = regressor @ truth + carried
    effort += noise * effort.std(axis=0) * random.normal(size=effort.shape)
    return filter_signals(Measured(time, q + 1e-5 * random.normal(size=q.shape), effort), CUTOFF, 100.0)


def against(found: Fit, truth: Vector) -> dict[str, Any]:
    """Return how near the base parameters are to the truth."""
    true, told = (found.base.combination @ values for values in (truth, found.parameters))
    error = np.abs(told - true) / np.maximum(np.abs(true), 1e-12)
    # a parameter whose true value is nothing has no relative error
    real = np.abs(true) > 1e-9
    shares = found.base_shares * np.abs(true / found.base_values)
    good = error < 0.02
    matters = real & (shares >= MATTERS)
    deviations = found.base_deviations / np.maximum(np.abs(true), 1e-12)
    sure = real & (deviations < 0.005)
    return {
        "condition": round(found.condition),
        "base": int(real.sum()),
        "within_2_percent": int((good & real).sum()),
        "matter": int(matters.sum()),
        "matter_within_2_percent": int((good & matters).sum()),
        "matter_and_deviation_below_2_percent": int((matters & (deviations < 0.02)).sum()),
        "largest_deviations_percent": np.sort(100.0 * deviations[matters])[-8:].round(1).tolist(),
        "sure": int(sure.sum()),
        "sure_within_2_percent": int((good & sure).sum()),
        "share_weighted_within_2_percent": round(float(shares[good & real].sum() / shares[real].sum()), 3),
        "residual_percent": (100.0 * found.residual).round(2).tolist(),
        "published_percent": (100.0 * found.published_residual).round(1).tolist(),
    }


def synthetic(noise: float) -> dict[str, Any]:
    """Identify another arm from a random and from designed motions of growing length."""
    arm = of_psm(TOOL)
    model = LinearModel(arm)
    truth = another_arm(model)
    table = {
        "random, 60 s": against(fit([noisy(model, truth, *random_motion(arm, 60.0, 3), noise)], arm), truth)
    }
    recorded: list[Samples] = []
    for seed in (0, 1):
        motion = excitation(arm, 3, RATE, seed)
        recorded.append(noisy(model, truth, motion.time, motion.q, noise))
        table[f"designed, {len(recorded)} x 60 s"] = against(fit(recorded, arm), truth)
    motion = excitation(arm, 9, RATE)
    found = fit([noisy(model, truth, motion.time, motion.q, noise)], arm)
    table["designed, 180 s"] = against(found, truth)
    return table


def simulated() -> dict[str, Any]:
    """Identify the simulated arm from a recording of `configs/identify.yaml`; its truth is the model."""
    arm = of_psm(TOOL, jaw=True)
    joints = [joint.name for joint in arm.joints]
    with TemporaryDirectory() as directory:
        recording = Path(directory, "identify")
        trocar.run("identify", record=recording)
        measured = measurements(recording, "PSM1", joints)
    found = fit([filter_signals(measured, CUTOFF, 100.0)], arm)
    return against(found, LinearModel(arm, shape=found.model.shape).nominal)


def wpi(path: Path, rate: float) -> Measured:
    """Return the joint states of a file of that repository, with the jaw.

    Rows of 21 numbers without names or times: positions, velocities, efforts of yaw, pitch, insertion, roll
    and the last three motors, after their ratios (main_psm.ipynb there, M_motor2dvrk_q).
    """
    table = np.loadtxt(path, delimiter=",", ndmin=2)
    q, effort = table[:, :7].copy(), table[:, 14:21].copy()
    q[:, 4:] = q[:, 4:] @ MOTOR_TO_JOINT.T
    effort[:, 4:] = np.linalg.solve(MOTOR_TO_JOINT.T, effort[:, 4:].T).T
    return Measured(np.arange(len(q)) / rate, q, effort)


def of_motors(efforts: Vector) -> Vector:
    """Return efforts of seven joints with the last three as those of the motors, shape (N, 7)."""
    return np.hstack([efforts[:, :4], efforts[:, 4:] @ MOTOR_TO_JOINT])


def compared(train: Path, test: Path, rate: float) -> dict[str, Any]:
    """Fit on one recording and judge on the other."""
    ours = train.read_text("utf-8").startswith("time")
    arm = of_psm(TOOL, jaw=not ours)
    joints = [joint.name for joint in arm.joints]
    pair = [measurements(path, "PSM1", joints) if ours else wpi(path, rate) for path in (train, test)]
    seen, judged = (filter_signals(measured, CUTOFF, 100.0) for measured in pair)
    result: dict[str, Any] = {}
    for stribeck in (False, True):
        found = fit([seen], arm, stribeck=stribeck, judged=judged)
        predicted, published, measured = (
            efforts[found.test] if ours else of_motors(efforts[found.test])
            for efforts in (found.predicted, found.published, found.measured)
        )
        left = relative_residual(predicted, measured)
        result["stribeck" if stribeck else "coulomb"] = {
            "residual_percent": (100.0 * left).round(1).tolist(),
            "published_percent": (100.0 * relative_residual(published, measured)).round(1).tolist(),
        }
        if not ours:
            first = slice(round(WPI_PERIOD * 100.0))  # samples a second
            left = relative_residual(predicted[first], measured[first])
            result["stribeck" if stribeck else "coulomb"]["against_wpi"] = (left / WPI).round(2).tolist()
    return result


def main() -> None:
    """Print the tables as JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--train", type=Path)
    parser.add_argument("--test", type=Path)
    parser.add_argument("--noise", type=float, default=0.05)
    parser.add_argument("--rate", type=float, default=200.0, help="rows in a second of files without times")
    arguments = parser.parse_args()
    if arguments.train and arguments.test:
        print(json.dumps(compared(arguments.train, arguments.test, arguments.rate), indent=2))
        return
    start = process_time()
    print(json.dumps({"synthetic": synthetic(arguments.noise), "simulated": simulated()}, indent=2))
    print(f"processor time {process_time() - start:.0f} s")


if __name__ == "__main__":
    main()
