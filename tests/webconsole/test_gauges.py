"""Numbers of the hub on the page: energy books, pace, latencies; and late steps as events of a recording."""

import numpy as np
import pytest

from hub.planning.scenario_file import load
from hub.recording.recorder import Recorder
from hub.session.launch import plan_of
from schemas.codec import encode
from schemas.keys import Keys, topic
from schemas.ros import Header
from schemas.trocar_msgs import CouplingEnergy, Latency, SessionStatus
from webconsole.gauges import GAUGES
from webconsole.recorded import Recorded
from webconsole.stage import Stage

BOND = "robot/PSM1/probe"


def status(step, late=0, refused=0, latencies=()):
    return SessionStatus(
        session="palpation",
        run=1,
        state="running",
        step=step,
        sim_time_ns=step * 10**9,
        real_time_factor=0.9,
        late_steps=late,
        dropped_messages=refused,
        latencies=list(latencies),
    )


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    directory = tmp_path_factory.mktemp("gauges") / "palpation"
    file = load("palpation", [])
    plan, _ = plan_of(file.scenario, file.params)
    keys = Keys("palpation")
    attachments = {
        "scenario.json": file.scenario.model_dump_json().encode(),
        "plan.json": plan.model_dump_json().encode(),
    }
    with Recorder(directory, attachments=attachments) as recorder:
        books = recorder.add_channel(topic(keys.energy(BOND)), CouplingEnergy.ros_type)
        statuses = recorder.add_channel(topic(keys.status), SessionStatus.ros_type)
        for step, (late, refused) in enumerate([(0, 0), (2, 0), (2, 1)]):
            book = CouplingEnergy(
                header=Header(), bond=BOND, motion_work_j=step, force_work_j=2 * step, residual_j=step
            )
            recorder.write(books, step * 10**9, encode(book))
            recorder.write(statuses, step * 10**9, encode(status(step, late, refused)))
    return Recorded(directory)


def test_the_energy_book_of_a_bond_is_a_series(recorded):
    columns, rows = recorded.series(f"hub.energy/{BOND}", 0.0, 10.0, 100)
    assert columns == list(GAUGES[CouplingEnergy.ros_type].columns)
    assert rows.tolist() == [[0, 0, 0, 0], [1, 1, 2, 1], [2, 2, 4, 2]]


def test_a_page_is_offered_them_and_gets_samples(recorded):
    stage = Stage(recorded.scenario, recorded.outlets, recorded.params)
    offered = {one["name"]: one for one in stage.describe()["numbers"]}
    assert offered[f"hub.energy/{BOND}"]["units"]["residual"] == "J"
    section = stage.sample(0, "hub.status", recorded.newest("hub.status", 1_500_000_000))
    row = np.frombuffer(section.content, "<f8")
    assert row[:4].tolist() == [1.0, 0.9, 2.0, 0.0]
    assert len(row) == 1 + len(offered["hub.status"]["columns"])


def test_late_steps_and_refused_messages_are_events(recorded):
    found = [(one.time_s, one.level, one.text) for one in recorded.events]
    assert found == [(1.0, "warn", "2 late steps"), (2.0, "warn", "1 message refused")]


def test_of_several_streams_the_slowest_counts():
    def latency(way, stream, p50, count=1):
        return Latency(way=way, stream=stream, count=count, p50_s=p50, p99_s=2 * p50, largest_s=1.0)

    message = status(
        1,
        latencies=[
            latency("device to grant", "a", 0.001),
            latency("device to grant", "b", 0.003),
            latency("state to force", "a", 9.0, count=0),
        ],
    )
    gauge = GAUGES[SessionStatus.ros_type]
    named = dict(zip(gauge.columns, gauge.read(encode(message)), strict=True))
    assert (named["device latency.p50"], named["device latency.p99"]) == pytest.approx((3.0, 6.0))
    assert np.isnan(named["force latency.p50"])
