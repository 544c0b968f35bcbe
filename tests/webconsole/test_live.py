"""A running session as pages see it: what arrives, what it costs the session, and what is asked of it."""

import asyncio
import subprocess
import sys
import threading

import numpy as np
import pytest
import zenoh

from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.transport.control_messages import DescribeReply, Empty
from hub.transport.envelope import Tag
from hub.transport.page_feed import PageFeed
from hub.transport.port_codec import PortCodec
from hub.transport.zenoh_session import open_session
from hub.verify import verify
from schemas.errors import ConnectError, MessageError
from schemas.ports import Port
from schemas.ros import Joy
from schemas.trocar_msgs import SoftBodyState
from tests.waiting import until
from webconsole.commands import Network, Tune
from webconsole.console import Console
from webconsole.live import Live
from webconsole.pilot import Pilots
from webconsole.stage import Stage

SCENARIO = """\
name: seen
step: 1 ms
duration: 1 s
scene:
  arms: {PSM1: {instrument: palpation-probe}}
participants:
  robot: {kind: mujoco}
"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    file = tmp_path_factory.mktemp("seen") / "seen.yaml"
    file.write_text(SCENARIO)
    return load(str(file), [])


def test_a_session_that_is_seen_has_the_same_state_hash(scenario):
    """It is paused and stepped meanwhile, and everything that can be drawn is subscribed to."""
    alone = launch(scenario).run()
    session = launch(scenario)
    seen, failed = {}, []

    def look():
        live = Live(session.endpoint, "seen")
        live.start()
        try:
            until(lambda: live.generation)
            live.ask("pause", Empty(), Empty)
            stage = Stage(live.scenario, live.outlets, live.params)
            live.want(stage.shown | {"robot.PSM1/measured_js"})
            live.ask("resume", Empty(), Empty)
            value = until(lambda: live.newest("robot.qpos", None))
            poses = stage.poses("robot", {"robot.qpos": value})
            seen.update(poses=poses, bodies=stage.scenes["robot"].bodies)
            seen.update(js=until(lambda: live.newest("robot.PSM1/measured_js", None)))
            until(lambda: live.state["state"] == "away")
        except Exception as error:  # noqa: BLE001  # it is raised below, in the thread of the test
            failed.append(error)
        finally:
            live.close()

    session.state.pause()
    looking = threading.Thread(target=look)
    looking.start()
    summary = session.run()
    looking.join()
    assert failed == []
    assert summary.state_hash == alone.state_hash
    assert seen["poses"].shape == (len(seen["bodies"]), 7)
    assert np.allclose(np.linalg.norm(seen["poses"][:, 3:], axis=1), 1.0, atol=1e-5)


def test_a_network_link_is_changed_and_the_session_can_be_verified(tmp_path):
    """The samples that arrived are in the grants, so what the link did to them is as well."""
    file = load("table", ["duration=0.3 s", "participants.robot.looks=false"])
    session = launch(file, record=tmp_path / "table", one_host=True)
    failed = []

    def change():
        live = Live(session.endpoint, "table")
        try:
            live.start()
            until(lambda: live.state.get("links"))
            console = Console(live, Pilots())
            order = Network(do="network", device="stylus", delay=0.035, loss=0.25)
            asyncio.run(console.network(order))
            (link,) = live.state["links"]
            assert (link["delay"], link["jitter"], link["loss"]) == (0.035, 0.0, 0.25)
            assert "35 ms each way, 25 % lost" in live.entries_after(0)[1][-1].text
            with pytest.raises(MessageError, match="no device 'stylo'"):
                asyncio.run(console.network(Network(do="network", device="stylo", loss=0.5)))
            live.ask("resume", Empty(), Empty)
        except Exception as error:  # noqa: BLE001  # it is raised below, in the thread of the test
            failed.append(error)
            session.state.shutdown()
        finally:
            live.close()

    session.state.pause()
    changing = threading.Thread(target=change)
    changing.start()
    summary = session.run()
    changing.join()
    assert failed == []
    recording = Recording(tmp_path / "table")
    assert summary.state_hash != launch(file, one_host=True).run().state_hash
    assert verify(recording).same


@pytest.mark.long
@pytest.mark.parametrize(
    ("scenario", "name", "value", "words"),
    [
        ("pick", "robot.gravity", 1.62, "gravity: 9.81 to 1.62 m/s^2"),
        ("palpation", "tissue.probe/stiffness", None, "probe/stiffness"),
    ],
)
def test_a_changed_parameter_enters_with_a_grant_and_the_session_can_be_verified(
    tmp_path, scenario, name, value, words
):
    """What is set by hand is in the grants, so a re-simulation sets it at the same step."""
    file = load(scenario, ["duration=0.6 s", "participants.robot.looks=false", "pace=fast"])
    session = launch(file, record=tmp_path / "tuned", one_host=True)
    failed = []

    def change():
        live = Live(session.endpoint, file.scenario.name)
        try:
            live.start()
            (shown,) = [one for one in until(lambda: live.state.get("tunables")) if one["name"] == name]
            least, most = shown["limits"]
            assert shown["value"] == shown["start"]
            wanted = 0.5 * (least + most) if value is None else value
            console = Console(live, Pilots())
            with pytest.raises(MessageError, match="outside its limits"):
                asyncio.run(console.tune(Tune(do="tune", name=name, value=2.0 * most)))
            with pytest.raises(MessageError, match="no parameter that may change"):
                asyncio.run(console.tune(Tune(do="tune", name="robot.gravitas", value=1.0)))
            asyncio.run(console.tune(Tune(do="tune", name=name, value=wanted)))
            assert words in live.entries_after(0)[1][-1].text
            described = live.ask("describe", Empty(), DescribeReply)
            assert described.tuned == {name: wanted}, "another page finds the value as it is"
            live.ask("resume", Empty(), Empty)
        except Exception as error:  # noqa: BLE001  # it is raised below, in the thread of the test
            failed.append(error)
            session.state.shutdown()
        finally:
            live.close()

    session.state.pause()
    changing = threading.Thread(target=change)
    changing.start()
    summary = session.run()
    changing.join()
    assert failed == []
    assert verify(Recording(tmp_path / "tuned")).same
    assert summary.state_hash != launch(file, one_host=True).run().state_hash


@pytest.mark.long
def test_force_against_depth_needs_no_page_that_draws_fast():
    """Every value that arrives is kept, whether or not a page takes it."""
    session = launch(load("palpation", ["duration=1 s", "participants.robot.looks=false", "pace=realtime"]))
    traces, failed = [], []

    def look():
        live = Live(session.endpoint, "palpation")
        live.start()
        try:
            until(lambda: live.generation)
            console = Console(live, Pilots())
            stage = asyncio.run(console.stage())
            console.want("a page that acknowledges nothing", stage.shown)
            live.ask("resume", Empty(), Empty)
            (history,) = stage.histories.values()
            traces.append(until(lambda: len(history.trace.times_s) > 5 and history.trace))
        except Exception as error:  # noqa: BLE001  # it is raised below, in the thread of the test
            failed.append(error)
            session.state.shutdown()
        finally:
            live.close()

    session.state.pause()
    looking = threading.Thread(target=look)
    looking.start()
    session.run()
    looking.join()
    assert failed == []
    assert traces[0].position.shape == traces[0].force.shape
    assert (np.diff(traces[0].times_s) > 0.0).all()


def test_without_a_session_it_says_so_and_goes_on():
    live = Live(session="nothing", pid=-1)
    live.start()
    until(lambda: "nothing" in live.state["detail"])
    with pytest.raises(ConnectError, match="no session is running"):
        live.ask("pause", Empty(), Empty)
    live.close()


@pytest.mark.long
def test_a_hub_that_is_killed_is_missed_and_the_next_one_is_shown(tmp_path):
    (tmp_path / "seen.yaml").write_text(SCENARIO.replace("name: seen", "name: lost").replace("1 s", "10 min"))
    command = [sys.executable, "-P", "-m", "trocar", "run", str(tmp_path / "seen.yaml"), "--pace", "realtime"]
    live = Live(session="lost")
    live.start()
    try:
        for generation in (1, 2):
            quiet = subprocess.DEVNULL
            with subprocess.Popen(command, stdout=quiet, stderr=quiet) as hub:
                try:
                    until(lambda: live.state["state"] == "running")
                    assert live.generation == generation
                finally:
                    hub.kill()
            until(lambda: live.state["state"] == "away")
            assert "'lost'" in live.state["detail"]
    finally:
        live.close()


@pytest.fixture(scope="module")
def ether():
    """A Zenoh session that reaches itself alone."""
    with open_session("peer") as session:
        yield session


@pytest.fixture
def feed(ether, request):
    """Return a feed of a port, and the list of what a page receives of it once it subscribes."""

    class Fed:
        def __init__(self, port):
            self.key, self.changes, self.got = f"trocar/test/{request.node.name}", [], []
            self.codec = PortCodec(port)
            self.feed = PageFeed(ether, self.key, self.codec, 7, lambda: self.changes.append(1))

        def subscribe(self):
            take = zenoh.handlers.Callback(self.take, indirect=False)
            self.subscriber = ether.declare_subscriber(self.key, take)
            until(lambda: self.feed.needed)

        def take(self, sample):
            self.got.append((Tag.of(sample).step, self.codec.decode(sample.payload.to_bytes())))

    made = []

    def make(port):
        made.append(Fed(port))
        return made[-1]

    yield make
    for one in made:
        one.subscriber.undeclare()
        one.feed.close()


def test_of_a_signal_pages_get_some_values_a_second(feed):
    one = feed(Port(name="x", causality="output"))
    assert not one.feed.needed
    one.subscribe()
    assert one.changes
    for step in range(1000):
        one.feed.put(step, step, np.array([float(step)]))
    assert 1 <= len(one.got) < 500
    assert one.got[0][0] == 0


def test_of_events_pages_get_each(feed):
    one = feed(Port(name="x", causality="output", type=Joy.ros_type, variability="event"))
    one.subscribe()
    for step in range(20):
        one.feed.put(step, step, (Joy(buttons=np.array([step], np.int32)),))
    assert [message.buttons[0] for _, message in one.got] == list(range(20))


def test_a_page_that_comes_late_gets_the_surface_of_an_organ(feed):
    one = feed(Port(name="x", causality="output", type=SoftBodyState.ros_type))
    nodes = np.zeros(9, np.float32)
    one.feed.keep_first(
        0, SoftBodyState(header={}, body="liver", nodes_m=nodes, triangles=np.arange(3, dtype="u4"))
    )
    one.subscribe()
    one.feed.put(500, 500, SoftBodyState(header={}, body="liver", nodes_m=nodes))
    assert [(step, message.triangles.size) for step, message in one.got] == [(-1, 3), (500, 0)]
