from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from controllers.motion.controller import MotionController
from controllers.motion.params import MotionParams
from devices.ros.params import GatewayParams
from devices.ros.topics.dvrk_table import NOT_SERVED, dvrk_table
from schemas.codec import message_type
from schemas.files import Files
from tests.devices.ros.crtk_table import PYTHON_CLIENT, WHOLE

PARAMS = GatewayParams.model_validate(WHOLE)
ROWS = {row.topic: row for row in dvrk_table(PARAMS)}

ARM_NAMES = {
    "subscribe": (
        "state_command hold free servo_jp servo_jr servo_jf move_jp move_jr servo_cp servo_cr move_cp"
        " servo_cs servo_ci body/servo_cf spatial/servo_cf use_gravity_compensation"
        " body/set_cf_orientation_absolute set_base_frame trajectory_j/set_ratio trajectory_j/set_ratio_v"
        " trajectory_j/set_ratio_a"
    ),
    "publish": (
        "operating_state desired_state goal_reached error warning status measured_js setpoint_js"
        " gravity_compensation/setpoint_js measured_cp setpoint_cp local/measured_cp local/setpoint_cp"
        " measured_cv local/measured_cv body/measured_cf spatial/measured_cf body/jacobian spatial/jacobian"
        " trajectory_j/ratio trajectory_j/ratio_v trajectory_j/ratio_a"
    ),
    "serve": "forward_kinematics local/forward_kinematics inverse_kinematics",
}
"""As the bridge of the real system lists them (jhu-cisst/cisst-ros, commit 73aca61c)."""


@pytest.mark.parametrize("arm", ["PSM1", "PSM2", "PSM3", "ECM"])
def test_an_arm_has_every_name_of_the_real_bridge(arm: str) -> None:
    for way, names in ARM_NAMES.items():
        for name in names.split():
            assert ROWS[f"/{arm}/{name}"].way == way
            assert ROWS[f"/{arm}/{name}"].name == name
    assert not NOT_SERVED.keys() & {row.name for row in ROWS.values()}


def test_python_clients_find_a_peer_for_all_they_declare() -> None:
    assert ROWS.keys() >= PYTHON_CLIENT


def test_topics_and_ports_are_unique_and_of_known_types() -> None:
    rows = dvrk_table(PARAMS)
    ports = [row.port for row in rows if row.port is not None]
    assert len({row.topic for row in rows}) == len(rows)
    assert len({port.name for port in ports}) == len(ports)
    for row in rows:
        for part in ("_Request", "_Response") if row.way == "serve" else ("",):
            message_type(row.type + part)
        if row.port is not None:
            assert row.topic == f"/{row.port.name}"
            assert row.port.causality == ("input" if row.way == "publish" else "output")
            assert row.periodic <= (row.port.variability == "signal")


@pytest.mark.parametrize("mounting", ["free", "cart"])
@pytest.mark.parametrize("reference", ["camera", "base", "world"])
def test_it_fits_the_motion_controller(mounting: str, reference: str) -> None:
    """Every port of an arm has a row of the same type, frame and size, but for what the real bridge lacks."""
    told = {name: WHOLE[name] for name in ("arms",)} | {"mounting": mounting, "reference": reference}
    rows = {
        row.port.name: row.port
        for row in dvrk_table(GatewayParams.model_validate(told))
        if row.port is not None
    }
    ports = MotionController("motion", MotionParams.model_validate(told)).ports
    for port in ports:
        if port.name.startswith(("drive/", "sense/")) or port.name.endswith("setpoint_cv"):
            continue
        ours = rows[port.name]
        assert {ours.causality, port.causality} == {"input", "output"}
        assert (ours.type, ours.variability) == (port.type, port.variability)
        if port.variability == "signal":
            assert (ours.names, ours.fields, ours.size, ours.shape, ours.frame) == (
                port.names,
                port.fields,
                port.size,
                port.shape,
                port.frame,
            )


def test_events_are_latched_states_are_periodic_and_pictures_neither() -> None:
    assert ROWS["/PSM1/operating_state"].latched
    assert ROWS["/console/teleop/enabled"].latched
    assert ROWS["/PSM1/measured_js"].periodic
    picture = ROWS["/endoscope/left/image_raw"]
    assert not picture.latched
    assert not picture.periodic


def test_a_real_arm_is_the_other_way_round() -> None:
    master = ROWS["/MTML/measured_cp"]
    assert master.way == "subscribe"
    assert master.port is not None
    assert master.port.variability == "signal"
    assert master.port.max_age_ns > 0
    assert ROWS["/MTML/body/servo_cf"].way == "publish"
    assert not ROWS["/MTML/state_command"].latched
    assert not any(row.latched for row in ROWS.values() if row.owner == "MTML")


def test_a_namespace_is_of_what_is_simulated() -> None:
    topics = {row.topic for row in dvrk_table(GatewayParams.model_validate(WHOLE | {"namespace": "sim"}))}
    assert {"/sim/PSM1/measured_js", "/sim/tf", "/MTML/measured_js"} <= topics
    assert all(
        row.name == ROWS[row.topic.removeprefix("/sim")].name
        for row in dvrk_table(GatewayParams.model_validate({"namespace": "sim"}))
        if row.owner
    )


def test_an_arm_is_simulated_or_real() -> None:
    with pytest.raises(ValidationError, match="PSM1: an arm is either simulated"):
        GatewayParams.model_validate({"arms": {"PSM1": {}}, "listen": ["PSM1"]})


def test_a_description_that_is_not_there() -> None:
    with pytest.raises(ValidationError, match="trocar model export"):
        GatewayParams.model_validate({"robot_description": "nowhere.urdf"}, context=Files(Path()).context)


@pytest.mark.parametrize(
    ("topic", "moves"),
    [
        ("servo_jp", True),
        ("jaw/move_jp", True),
        ("body/servo_cf", True),
        ("hold", False),
        ("state_command", False),
    ],
)
def test_which_commands_move_an_arm(topic: str, moves: bool) -> None:
    assert ROWS[f"/PSM1/{topic}"].moves is moves


def test_real_pedals_come_in_instead_of_going_out():
    rows = [
        row
        for row in dvrk_table(
            GatewayParams.model_validate({"listen": ["footpedals"], "namespace": "simulation"})
        )
        if row.owner == "footpedals"
    ]
    assert {row.way for row in rows} == {"subscribe"}
    assert "/footpedals/clutch" in {row.topic for row in rows}
