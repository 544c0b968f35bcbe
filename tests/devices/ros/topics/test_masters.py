"""The topics of simulated masters."""

from devices.ros.params import GatewayParams
from devices.ros.topics.dvrk_table import dvrk_table
from robots.dvrk import crtk


def test_masters_have_what_programs_of_masters_use() -> None:
    rows = dvrk_table(GatewayParams.model_validate({"arms": {"MTML": {}}, "mounting": "cart"}))
    topics = {row.topic: row for row in rows}
    for command in (*crtk.COMMANDS, *crtk.MTM_COMMANDS):
        assert topics[f"/MTML/{command}"].way == "subscribe"
    for state in (
        *crtk.EVENTS,
        *crtk.MTM_EVENTS,
        "gripper/measured_js",
        "body/measured_cf",
        "spatial/jacobian",
    ):
        assert topics[f"/MTML/{state}"].way == "publish"
    assert topics["/MTML/inverse_kinematics"].way == "serve"
    pose = topics["/MTML/measured_cp"].port
    assert pose is not None
    assert pose.frame == "HRSV"
    assert not [topic for topic in topics if topic.startswith("/SUJ/MTML") or "MTML/gripper/servo" in topic]
