"""Names of version 0.1.0: still accepted in scenarios, with a warning that says where; read in recordings."""

import logging

import pytest
from pydantic import ValidationError

from hub.planning.plan import Plan
from hub.planning.renamed import current_names
from hub.planning.scenario_file import load
from schemas.errors import ScenarioError
from schemas.scenario import Scenario

KINDS = """
from typing import Literal

from hub.participant import Device, Params
from schemas.ports import Port


class New(Params):
    profile: Literal["dvrk", "vrep"] = "dvrk"


class Old(Params):
    profile: Literal["dvrk", "paper"] = "dvrk"


class Gateway(Device):
    params_model = New
    ports = (Port(name="pose", causality="output"),)

    def open(self, directory):
        pass

    def read(self, t):
        return ()

    def close(self):
        pass


class OldGateway(Gateway):
    params_model = Old
"""

GOOD = """\
name: old
step: 1 ms
participants:
  console: {kind: console, arms: [PSM1]}
  paper:
    kind: paper
    arms: {PSM1: {}}
  hand: &hand
    kind: gateway
    profile: paper
    link: {delay: 3 ms}
  other: {<<: *hand}
  before: {kind: old-gateway, profile: paper}
"""


@pytest.fixture(autouse=True)
def kinds(install_plugin):
    install_plugin(
        "gateways",
        {"trocar.devices": {"gateway": "gateways:Gateway", "old-gateway": "gateways:OldGateway"}},
        text=KINDS,
    )


@pytest.fixture
def write(tmp_path):
    def write(text):
        file = tmp_path / "old.yaml"
        file.write_text(text)
        return str(file)

    return write


def test_a_scenario_with_old_names_means_the_same(write):
    spec = load(write(GOOD)).scenario.participants
    kinds = {name: one.kind for name, one in spec.items()}
    assert kinds | {"console": "dvrk-console", "paper": "vrep"} == kinds
    assert spec["hand"].network_link.delay == spec["other"].network_link.delay == 3_000_000
    profiles = [spec[name].params["profile"] for name in ("hand", "other", "before")]
    assert profiles == ["vrep", "vrep", "paper"]  # a kind that knows the old value only keeps it


def test_each_place_of_an_old_name_is_one_warning_on_one_line(write, caplog):
    file = write(GOOD)
    load(file)
    still = "; this release still accepts the old name"
    assert [record.message for record in caplog.records if record.levelno == logging.WARNING] == [
        f"{file}:4:19: participants.console.kind: kind 'console' is now 'dvrk-console'{still}",
        f"{file}:6:11: participants.paper.kind: kind 'paper' is now 'vrep'{still}",
        f"{file}:11:5: participants.hand.link: 'link' is now 'network_link'{still}",
        f"{file}:10:14: participants.hand.profile: 'paper' is now 'vrep'{still}",
    ]


def test_two_places_are_two_warnings(write, caplog):
    specs = "".join(f"  {name}: {{kind: paper, arms: {{PSM1: {{}}}}}}\n" for name in "ab")
    load(write(f"name: old\nstep: 1 ms\nparticipants:\n{specs}"))
    assert [record.message.partition(": ")[0][-5:] for record in caplog.records] == [":4:13", ":5:13"]


@pytest.mark.parametrize("name", ["link", "network_link"])
def test_an_override_may_use_the_old_name(write, caplog, name):
    file = write(GOOD.replace("    link:", f"    {name}:"))
    caplog.clear()
    loaded = load(file, ["participants.hand.link.jitter=2 ms", "participants.hand.link.delay=5 ms"])
    link = loaded.scenario.participants["hand"].network_link
    assert (link.delay, link.jitter) == (5_000_000, 2_000_000)
    assert "'link' is now 'network_link'" in caplog.text


def test_an_override_is_named_in_its_warning(write, caplog):
    file = write(GOOD.replace("    link: {delay: 3 ms}\n", "").replace(": console", ": dvrk-console"))
    load(file, ["participants.hand.link.delay=5 ms"])
    warning = "--set participants.hand.link.delay=5 ms: participants.hand.link: 'link' is now 'network_link'"
    assert warning in caplog.text


@pytest.mark.parametrize(
    ("old", "new", "overrides", "expected"),
    [
        ("delay: 3 ms", "delay: 3 kg", [], "11:19: participants.hand.network_link.delay: '3 kg' is no"),
        ("delay: 3 ms", "dealy: 3 ms", [], "11:12: participants.hand.network_link.dealy: there is no"),
        (
            "",
            "",
            ["participants.hand.link.delay=3 kg"],
            "--set participants.hand.link.delay=3 kg: participants.hand.network_link.delay: '3 kg' is no",
        ),
        (
            "    link:",
            "    network_link: {}\n    link:",
            [],
            "12:5: participants.hand.link: there is no 'link' here. Known: host, kind, network_link,",
        ),
    ],
)
def test_an_error_in_a_renamed_value_has_the_place_where_it_is_written(write, old, new, overrides, expected):
    with pytest.raises(ScenarioError) as raised:
        load(write(GOOD.replace(old, new, 1) if old else GOOD), overrides)
    assert expected in str(raised.value)


def test_a_renamed_scenario_is_found_by_its_old_name(caplog):
    assert load("ros-paper").scenario == load("ros-vrep").scenario
    assert "scenario 'ros-paper' is now 'ros-vrep'" in caplog.text


def test_a_recorded_scenario_gets_the_current_names():
    hand = {"kind": "gateway", "profile": "paper", "link": {"delay": "3 ms"}}
    old = {"name": "old", "step": "1 ms", "participants": {"paper": {"kind": "paper"}, "hand": hand}}
    read = Scenario.model_validate(current_names(old)).participants
    assert read["paper"].kind == "vrep"
    assert read["hand"].network_link.delay == 3_000_000
    assert read["hand"].params == {"profile": "vrep"}


def test_a_recorded_plan_gets_the_current_names():
    pose = {"name": "pose", "causality": "output"}
    member = {"name": "hand", "role": "device", "host": "hub", "period": 1, "ports": [pose]}
    ends = {"source": "a", "source_port": "out", "target": "b", "target_port": "in"}
    plan = Plan.model_validate(
        {
            "step_ns": 1_000_000,
            "order": [],
            "members": {"hand": member | {"kind": "console", "link": {"delay": "3 ms"}}},
            "links": [ends | {"fresh": True, "linear": False}],
            "inlets": [
                {"device": "hand", "device_port": "pose", "target": "b", "target_port": "in", "max_age_ns": 0}
            ],
            "outlets": [
                {"source": "a", "source_port": "out", "device": "hand", "device_port": "force"},
            ],
            "bonds": [],
        }
    )
    hand = plan.participants["hand"]
    assert (hand.kind, hand.network_link.delay) == ("dvrk-console", 3_000_000)
    assert [(c.source, c.target) for c in plan.connections] == [("a", "b")]
    assert [(c.source, c.source_port) for c in plan.from_devices] == [("hand", "pose")]
    assert [(c.target, c.target_port) for c in plan.to_devices] == [("hand", "force")]
    assert Plan.model_validate_json(plan.model_dump_json()) == plan


@pytest.mark.parametrize(
    "plan",
    [
        {"members": None},
        {"members": {"hand": 7}},
        {"members": {"hand": {"host": "hub"}}},
        {"members": {}, "links": [], "inlets": 3},
        {"members": {}, "links": [], "inlets": [], "outlets": [True]},
    ],
)
def test_what_is_no_recorded_plan_is_an_error_of_validation(plan):
    with pytest.raises(ValidationError, match="not a plan"):
        Plan.model_validate(plan)
