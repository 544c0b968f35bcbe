"""PSM and ECM of the Si: the kinematics of the published tables, ranges and efforts, and where they stand."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

import trocar
from controllers.motion.params import MotionParams
from engines.mujoco.params import MujocoParams
from robots.dvrk import arms, cannula, drives, psm, si
from robots.dvrk.instruments import instrument
from robots.dvrk.inverse import inverse
from robots.dvrk.mounted.mounted_ecm import MountedEcm
from robots.dvrk.mounted.mounted_psm import MountedPsm
from schemas.errors import MotionError

SCENARIO = """
name: si
step: 10 ms
duration: 20 s
participants:
  robot:
    kind: mujoco
    publish_period: 10 ms
    arms:
      PSM1: {generation: si, instrument: "420006"}
      ECM: {generation: si, position: [0 mm, 300 mm, 100 mm], start: [0, 0, 50 mm, 0]}
"""
Q = np.array([1.9, -1.2, 0.15, 0.3, 0.2, -0.1])
"""Out of reach of the Classic."""


def table_pose(rows, q) -> np.ndarray:
    """Modified DH, by the book: rows of alpha, a, d, theta, and whether the joint slides."""
    pose = np.eye(4)
    for (alpha, a, d, theta, slides), value in zip(rows, q, strict=True):
        ca, sa = np.cos(alpha), np.sin(alpha)
        angle, along = (theta, d + value) if slides else (theta + value, d)
        ct, st = np.cos(angle), np.sin(angle)
        pose = pose @ np.array(
            [
                [ct, -st, 0, a],
                [st * ca, ct * ca, -sa, -sa * along],
                [st * sa, ct * sa, ca, ca * along],
                [0, 0, 0, 1],
            ]
        )
    return pose


def test_kinematics_of_the_psm_are_those_of_the_table() -> None:
    rows = (
        (pi / 2, 0, 0, pi / 2, False),
        (-pi / 2, 0, 0, -pi / 2, False),
        (pi / 2, 0, -0.4826, 0, True),
        (0, 0, 0.4670, 0, False),
        (-pi / 2, 0, 0, -pi / 2, False),
        (-pi / 2, 0.0091, 0, -pi / 2, False),
    )
    chain = arms.chain("PSM1", generation="si")
    tip = np.array([[0, -1, 0, 0], [0, 0, 1, 0], [-1, 0, 0, 0], [0, 0, 0, 1.0]])
    assert chain.forward(Q) == pytest.approx(table_pose(rows, Q) @ tip, abs=1e-12)
    mounted = MountedPsm(generation="si", instrument="420006", start=tuple(Q))
    assert mounted.chain.forward(Q) == pytest.approx(chain.forward(Q), abs=1e-12)
    assert [(joint.lower, joint.upper, joint.effort) for joint in mounted.chain.joints[:3]] == [
        (-2.964, 2.964, 17.0845),
        (-1.265, 1.301, 17.0845),
        (0.0, 0.290, 40.9063),
    ]
    with pytest.raises(MotionError):
        psm.chain(instrument("400006")).check(Q)


def test_closed_form_and_cannula_are_for_the_si_too() -> None:
    chain = MountedPsm(generation="si", instrument="420006").chain
    assert inverse(chain, chain.forward(Q), np.zeros(6)) == pytest.approx(Q, abs=1e-9)
    classic = psm.chain(instrument("400006"))
    assert cannula.Cannula.of(chain).offset == pytest.approx(cannula.Cannula.of(classic).offset, abs=1e-12)
    ecm = MountedEcm(generation="si").chain
    at = np.array([2.0, 1.0, 0.2, 1.5])
    assert inverse(ecm, ecm.forward(at), np.array([0.0, 0.0, 0.1, 0.0])) == pytest.approx(at, abs=1e-9)
    assert cannula.Cannula.of(ecm).what == "the endoscope's insertion"


def test_drives_have_the_gains_and_efforts_of_the_si() -> None:
    yaw = MountedPsm(generation="si", instrument="420006").drives["yaw"]
    assert (yaw.stiffness, yaw.damping, yaw.effort) == (600.0, 30.0, 17.0845)
    assert drives.psm(instrument("400006"))["yaw"].stiffness == 120.0
    assert MountedEcm(generation="si").drives["pitch"].effort == 34.0845


def test_instruments_of_the_classic_do_not_fit() -> None:
    with pytest.raises(ValidationError, match="LARGE_NEEDLE_DRIVER_400006 does not fit a PSM of the Si"):
        MountedPsm(generation="si", instrument="400006")
    with pytest.raises(MotionError, match="no instrument of the S and Si"):
        arms.chain("PSM2", "400006", "si")
    with pytest.raises(ValidationError, match="does not fit"):
        MountedPsm(generation="si", instrument="420006", spares=("400049",))
    assert (
        MountedPsm(generation="si", instrument="420006", spares=("420049",)).variants[1].chain.joints[3].d
        < 0.42
    )


def test_the_cart_is_of_the_classic() -> None:
    scene = {"arms": {"PSM1": {"generation": "si", "instrument": "420006"}}, "mounting": "cart"}
    for model in (MujocoParams, MotionParams):
        with pytest.raises(ValidationError, match="PSM1: the cart is that of the Classic"):
            model.model_validate(scene)
        model.model_validate(scene | {"mounting": "free"})


def test_setup_joints_carry_the_arms_to_one_patient() -> None:
    tips = {arm: si.setup_chain(arm).forward(np.array(at)) for arm, at in si.SIMULATED.items()}
    assert len(si.setup_chain("PSM3").joints) == 5
    for arm, tip in tips.items():
        assert np.linalg.norm(tip[:3, 3] - tips["ECM"][:3, 3]) < 0.45, arm
        assert tip[2, 2] > 0.0, "upright"
    # SAW's table for PSM1, by the book
    rows = (
        (0, 0, 0.1471, 0, True),
        (0, 0, 0.6654, 0, False),
        (0, 0.4572, 0.1397, 0, False),
        (0, 0.4572, -0.1301, 0, False),
        (pi / 2, 0.0490, 0, np.radians(-45.0), False),
        (-pi / 2, 0, 0, 0, False),
    )
    base, offset = np.diag([-1.0, -1.0, 1.0, 1.0]), np.eye(4)
    base[:2, 3] = -0.2019, -0.0757
    offset[:3, :] = [[0, 1, 0, 0.8343], [-1, 0, 0, 0], [0, 0, 1, 0]]
    expected = base @ table_pose(rows, (*si.SIMULATED["PSM1"], 0.0, 0.0)) @ offset
    assert tips["PSM1"] == pytest.approx(expected, abs=1e-9)


def test_the_arms_of_the_si_move_beyond_the_classic(tmp_path: Path) -> None:
    file = tmp_path / "si.yaml"
    file.write_text(SCENARIO)
    goal, ecm_goal = np.array([1.9, -1.2, 0.2, 0.3, 0.2, -0.1]), np.array([0.5, 0.9, 0.1, 1.0])
    with trocar.SteppedSession(trocar.load_scenario(file)) as session:
        session.restart()
        for i in range(200):
            share = min(1.0, i / 150)
            start = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])
            session.advance(
                1,
                {
                    "robot.PSM1/servo_jp": start + share * (goal - start),
                    "robot.ECM/servo_jp": np.array([0.0, 0.0, 0.05, 0.0]) * (1.0 - share) + share * ecm_goal,
                },
            )
        assert session["robot.PSM1/measured_js"][:6] == pytest.approx(goal, abs=5e-3)
        assert session["robot.ECM/measured_js"][:4] == pytest.approx(ecm_goal, abs=5e-3)
