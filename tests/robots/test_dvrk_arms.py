import json
from pathlib import Path

import numpy as np
import pytest

from robots.command_line import fk, table
from robots.dvrk import arms, cart, ecm, mtm, psm
from robots.dvrk.setup_joints import SIMULATED
from schemas.errors import MotionError

REFERENCE = json.loads((Path(__file__).parent / "data" / "reference_poses.json").read_text())
AGREES = {"rtol": 0.0, "atol": 1e-9}


@pytest.mark.parametrize(
    "case", REFERENCE["local"], ids=lambda case: f"{case['arm']}-{case['tool']}-{case['q']}"
)
def test_every_arm_stands_where_the_reference_says(case):
    pose = fk(case["arm"], case["tool"], case["q"])
    assert np.allclose(pose["p"], case["p"], **AGREES)
    assert np.allclose(pose["R"], case["R"], **AGREES)


@pytest.mark.parametrize("case", REFERENCE["stereo_viewer"], ids=lambda case: f"{case['arm']}-{case['q']}")
def test_masters_stand_where_the_reference_says_before_the_stereo_viewer(case):
    tip = mtm.BASE[case["arm"]] @ arms.chain(case["arm"]).forward(np.array(case["q"], float))
    assert np.allclose(tip[:3, 3], case["p"], **AGREES)
    assert np.allclose(tip[:3, :3], case["R"], **AGREES)


def test_the_homed_cart_looks_to_its_camera_as_the_reference_says():
    camera = cart.camera_pose(ecm.chain().forward(np.array(ecm.HOME)), np.array(SIMULATED["ECM"]))
    seen = {"ECM": camera}
    for arm in ("PSM1", "PSM2", "PSM3"):
        seen[arm] = cart.base_in_view(arm, np.array(SIMULATED[arm]), camera) @ arms.chain(arm).forward(
            np.array(psm.HOME)
        )
    for case in REFERENCE["homed_cart"]:
        assert np.allclose(seen[case["arm"]][:3, 3], case["p"], **AGREES)
        assert np.allclose(seen[case["arm"]][:3, :3], case["R"], **AGREES)


@pytest.mark.parametrize("arm", arms.ARMS)
def test_every_arm_has_a_range_in_which_it_starts(arm):
    chain = arms.chain(arm)
    q = (
        SIMULATED[arm[4:]]
        if arm.startswith("SUJ/")
        else np.clip(np.zeros(len(chain.joints)), chain.lower, chain.upper)
    )
    chain.check(np.array(q))
    assert (chain.velocity > 0).all()
    assert (
        arm.startswith("SUJ/")
        or np.isfinite([chain.velocity, chain.acceleration, chain.jerk, chain.effort]).all()
    )


def test_endoscopes_look_thirty_degrees_apart():
    straight, up, down = (ecm.chain(kind).forward(np.array(ecm.HOME)) for kind in ("straight", "up", "down"))
    assert np.allclose(straight[:3, 3], up[:3, 3])
    assert np.allclose(
        [straight[:3, 2] @ up[:3, 2], straight[:3, 2] @ down[:3, 2], up[:3, 2] @ down[:3, 2]],
        np.cos(np.radians([30, 30, 60])),
    )


@pytest.mark.parametrize(
    ("arm", "tool", "q", "reason"),
    [
        ("PSM4", None, [0] * 6, "no arm 'PSM4'. Did you mean 'PSM3'"),
        (
            "PSM1",
            "PROGRASP_400093",
            [0] * 6,
            "no instrument 'PROGRASP_400093'. Did you mean 'PROGRASP_FORCEPS_400093'",
        ),
        ("ECM", "upp", [0] * 4, "no endoscope 'upp'. Did you mean 'up'"),
        ("MTML", "400006", [0] * 7, "arm 'MTML' holds no instrument"),
        (
            "PSM1",
            None,
            [0] * 4,
            "PSM1: 4 joint positions, expected 6: yaw, pitch, insertion, roll, wrist_pitch, wrist_yaw",
        ),
        ("ECM", None, [0, 0, 0.3, 0], "joint insertion at 0.3 m, allowed are 0 .. 0.255"),
        ("ECM", None, [0, 0, float("inf"), 0], "not all positions are finite"),
    ],
)
def test_what_no_arm_can_do_is_refused_with_what_it_can(arm, tool, q, reason):
    with pytest.raises(MotionError) as refusal:
        fk(arm, tool, q)
    assert reason in str(refusal.value)


def test_a_pose_reads_as_a_table():
    lines = table(fk("PSM1", "400006", [0, 0, 0, 0, 0, 0])).splitlines()
    assert lines[1] == "tip in frame PSM1_base"
    assert lines[2].split()[2:] == ["0.000000000", "0.000000000", "0.006500000"]
    assert [line.split()[0] for line in lines[3:]] == ["R"] * 3


def test_the_pose_goes_through_json_unchanged():
    pose = fk("SUJ/ECM", None, [0.2, 0.3, -0.5, 0.4])
    assert json.loads(json.dumps(pose)) == pose
    assert pose["frame"] == "cart"
    assert pose["joints"] == ["lift", "shoulder", "elbow", "wrist", "tilt", "mount"]


def test_a_snake_wrist_is_straight_at_zero_and_bends_by_the_sum_of_its_joints():
    straight = np.array(fk("PSM1", "400117", [0, 0, 0.12, 0, 0, 0, 0, 0])["R"])
    bent = np.array(fk("PSM1", "400117", [0, 0, 0.12, 0, 0.3, 0, 0, 0.2])["R"])
    assert np.allclose(straight[:, 2], [0, 0, -1], atol=1e-15)
    assert np.arccos(straight[:, 2] @ bent[:, 2]) == pytest.approx(0.5)


def test_the_elbow_of_a_master_hangs_on_its_shoulder():
    joints = mtm.ACTUATOR_TO_JOINT @ [0.1, 0.2, 0.5, 0.3, 0.4, 0.5, 0.6]
    assert np.allclose(joints, [0.1, 0.2, 0.5 - 0.2, 0.3 + 0.6697 * (0.2 - 0.5), 0.4, 0.5, 0.6], atol=1e-15)
