import logging

import pytest

from hub.devices.diagnostics_log import DiagnosticsLog
from hub.participant import Device, Params
from hub.planning.wiring import make_plan
from hub.transport.refusals import Refusals
from hub.transport.run_connection import RunConnection
from hub.transport.zenoh_session import open_session
from schemas.codec import encode
from schemas.keys import Keys
from schemas.ports import Port
from schemas.ros import DiagnosticStatus, StringMessage
from schemas.scenario import Scenario
from tests.hub.authorities import free_endpoint
from tests.waiting import until

TYPE = DiagnosticStatus.ros_type


class Stylus(Device):
    """Has two conditions."""

    ports = tuple(
        Port(name=name, causality="output", type=TYPE, variability="event", clock="wall")
        for name in ("diagnostics", "right/diagnostics")
    )

    def open(self, directory):
        pass

    def read(self, t):
        return []

    def close(self):
        pass


@pytest.fixture
def wire():
    """A hub that subscribes to `far` on another machine and not to `near`, and a session that may send."""
    specs = {"far": {"kind": "stylus", "host": "remote"}, "near": {"kind": "stylus", "host": "desk"}}
    plan = make_plan(
        Scenario.model_validate({"name": "s", "step": "1 ms", "duration": "1 s", "participants": specs}),
        {name: Stylus(name, Params()) for name in specs},
        dict.fromkeys(specs, "device"),
    )
    endpoint, refusals, keys = free_endpoint(), Refusals(), Keys("s")
    with (
        open_session("router", listen=[endpoint]) as hub,
        open_session("client", connect=[endpoint]) as device,
    ):
        diagnostics = DiagnosticsLog(RunConnection(hub, keys, plan, 1, refusals))
        yield (
            (lambda source, port, message: device.put(keys.output("device", source, port), encode(message))),
            refusals,
        )
        diagnostics.undeclare()


def test_the_hub_logs_the_diagnoses_of_remote_devices_once(wire, caplog):
    caplog.set_level(logging.INFO, "hub.devices.diagnostics_log")
    say, refusals = wire
    say("near", "diagnostics", DiagnosticStatus(level=2, name="near", message="logged by its own host"))
    for level, message in [(2, "absent;\nplug it in"), (2, "absent;\nplug it in"), (0, "there")]:
        say("far", "diagnostics", DiagnosticStatus(level=level, name="any", message=message))
    say("far", "right/diagnostics", DiagnosticStatus(level=1, name="far/right", message="warm" * 1000))
    say("far", "right/diagnostics", StringMessage(data="no diagnosis"))

    def lines(source):
        records = [record for record in caplog.records if record.name == "hub.devices.diagnostics_log"]
        return [
            (record.levelname, record.getMessage())
            for record in records
            if f"'{source}'" in record.getMessage()
        ]

    until(lambda: refusals.total == 1 and len(lines("far")) == 2 and lines("far/right"))
    assert lines("far") == [
        ("WARNING", "device 'far' reports: absent; plug it in"),
        ("INFO", "device 'far' reports: there"),
    ]
    ((level, message),) = lines("far/right")
    assert (level, message[:37]) == ("WARNING", "device 'far/right' reports: warmwarmw")
    assert len(message) < 600
    assert lines("near") == []
