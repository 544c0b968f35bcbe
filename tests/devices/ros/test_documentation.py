"""docs/ros.md is correct: its tables equal those of the gateways, and its commands and scenarios work.

`python -m tests.devices.ros.test_documentation` prints the tables.
"""

import json
import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest

from devices.ros.params import GatewayParams
from devices.ros.topics.dvrk_table import NOT_SERVED, dvrk_table
from devices.ros.topics.vrep_table import vrep_table
from hub.planning.scenario_file import load
from hub.session.launch import plan_of
from tests.devices.ros.bags.test_player import joints
from tests.devices.ros.crtk_table import WHOLE
from tests.devices.ros.zenoh.test_console import gated
from tests.devices.ros.zenoh.test_gateway import JOINTS, STATE
from tests.devices.ros.zenoh.zenoh_peer import Peer
from tests.hub.recording.ros_bags import write
from tests.waiting import until

__all__ = ["gated"]

PAGE = Path(__file__).parents[3] / "docs" / "ros.md"
TEXT = PAGE.read_text("utf-8")
HOLDING = {"instrument": "400006"}
SHOWN = GatewayParams.model_validate({name: value for name, value in WHOLE.items() if name != "listen"})
UNDER = {
    **{f"SUJ/{arm}": "/SUJ/<arm>" for arm in ("PSM1", "PSM2", "PSM3", "ECM")},
    **dict.fromkeys(("MTMR_PSM1", "MTML_PSM2"), "/<MTM>_<arm>"),
    "endoscope": "/<camera>",
    "dvrk/PSM1": "/dvrk/<PSM>",
    "dvrk/PSM2": "/dvrk/<PSM>",
}
"""Names of owners on the page."""


def lines_of(rows):
    """Return the lines of a table: one per owner, way and type; topics of all arms are under `<arm>`."""
    having = {}
    for row in rows:
        having.setdefault((row.name, row.type), []).append(row.owner)
    groups = {}
    for row in rows:
        psm, ecm = "PSM1" in having[row.name, row.type], "ECM" in having[row.name, row.type]
        arm = "/<arm>" if psm and ecm else "/<PSM>" if psm else "/ECM"
        under = (
            arm
            if row.owner in ("PSM1", "PSM2", "PSM3", "ECM")
            else UNDER.get(row.owner, f"/{row.owner}".rstrip("/"))
        )
        names = groups.setdefault((under, way_of(row), re.sub("/(msg|srv)/", "/", row.type)), [])
        names += [] if row.name in names else [row.name]
    order = list(dict.fromkeys(under for under, *_ in groups))
    lines = sorted(groups.items(), key=lambda group: (order.index(group[0][0]), WAYS.index(group[0][1])))
    return [
        f"| `{under}/` | {', '.join(f'`{name}`' for name in names)} | {type_} | {way} |"
        for (under, way, type_), names in lines
    ]


WAYS = ["states", "events", "pictures", "received", "service"]


def way_of(row):
    if row.way == "publish":
        return (
            "states" if row.periodic else "pictures" if row.name.startswith(("left/", "right/")) else "events"
        )
    return {"subscribe": "received", "serve": "service"}[row.way]


def tables():
    """Return the tables of the page."""
    own = GatewayParams.model_validate(
        {"profile": "vrep", "arms": {"PSM1": HOLDING, "PSM2": HOLDING, "ECM": {}}}
    )
    missing = [f"| `{name}` | {why} |" for name, why in NOT_SERVED.items()]
    return {"TABLE": lines_of(dvrk_table(SHOWN)), "MISSING": missing, "PAPER": lines_of(vrep_table(own))}


@pytest.mark.parametrize("name", ["TABLE", "MISSING", "PAPER"])
def test_its_tables_are_those_of_the_gateways(name):
    assert "\n".join(tables()[name]) in TEXT


SESSIONS = re.findall(r"trocar run ([a-z-]+)((?: --set (?:'[^']+'|\S+))*)", TEXT)


@pytest.mark.parametrize(("name", "overrides"), sorted(set(SESSIONS)))
def test_its_sessions_can_be_run(name, overrides):
    scenario = load(name, shlex.split(overrides)[1::2])
    plan, _ = plan_of(scenario.scenario, scenario.params)
    assert plan.order


def test_its_scenario_is_driven_by_the_bag_of_a_real_arm(tmp_path):
    (whole,) = re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)
    topics = (("/PSM1/setpoint_js", 6), ("/PSM1/jaw/setpoint_js", 1))
    states = [
        (0.1 * k, topic, joints(0.1 * k, *[0.01 * k] * count)) for k in range(3) for topic, count in topics
    ]
    (tmp_path / "data").mkdir()
    write(tmp_path / "data" / "suturing", states)
    (tmp_path / "suturing.yaml").write_text(whole)
    loaded = load(str(tmp_path / "suturing.yaml"))
    plan, _ = plan_of(loaded.scenario, loaded.params)
    assert {inlet.target_port for inlet in plan.from_devices} == {"PSM1/servo_jp", "PSM1/jaw/servo_jp"}


def test_its_settings_of_zenoh_let_a_program_in(gated):
    """As rmw_zenoh reads ZENOH_CONFIG_OVERRIDE: `key=value`, with semicolons between."""
    gateway, endpoint, authority = gated
    (override,) = re.findall(r"ZENOH_CONFIG_OVERRIDE=(\S*tls\S*)", TEXT)
    (spelt_out,) = shlex.split(
        override.replace("$PEM", str(authority.issued("console").file)).replace("tls/hub.lab:7447", endpoint)
    )
    settings = {
        key: json.loads(value)
        for key, _, value in (setting.partition("=") for setting in spelt_out.split(";"))
    }
    heard = []
    with Peer(endpoint, settings=settings) as console:
        console.listen(STATE, JOINTS, lambda message, _: heard.append(message))
        assert until(lambda: gateway.write(STATE[1:], np.zeros(18)) or heard)


if __name__ == "__main__":
    for name, lines in tables().items():
        sys.stdout.write(f"@{name}@\n" + "\n".join(lines) + "\n")
