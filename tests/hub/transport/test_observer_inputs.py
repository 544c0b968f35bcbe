"""What an observer sees: the newest state of which all inputs have arrived, and first that at time 0."""

import numpy as np
import pytest

from hub.transport.bundle import Bundle
from hub.transport.envelope import Tag
from hub.transport.observer_inputs import ObserverInputs
from hub.transport.port_codec import PortCodec
from hub.transport.refusals import Refusals
from hub.transport.run_connection import RunConnection
from hub.transport.zenoh_session import open_session
from schemas.keys import Keys
from tests.hub.authorities import free_endpoint
from tests.hub.parts import Part, into, out, plan_of
from tests.waiting import until

KEYS, RUN, MS = Keys("looks"), 7, 1_000_000


class Camera(Part):
    observer = True


class Sources:
    """A robot with a value every 2 ms, tissue with one every 100 ms, and a camera with a period of 40 ms."""

    def __init__(self, session):
        camera = Camera("camera", into("a"), into("b"))
        self.plan = plan_of(
            Part("robot", out()),
            Part("tissue", out()),
            camera,
            step="2 ms",
            pace="realtime",
            specs={"tissue": {"period": "100 ms"}, "camera": {"period": "40 ms"}},
            connections=["robot.out -> camera.a", "tissue.out -> camera.b"],
        )
        self.refusals = Refusals()
        run = RunConnection(session, KEYS, self.plan, RUN, self.refusals)
        self.inputs = ObserverInputs(run, "camera", self._count)
        self.arrived = 0
        self.bundles = {
            name: Bundle(session, KEYS.signals(name, "camera"), lambda: None) for name in ("robot", "tissue")
        }
        until(lambda: all(one.takes(0, 1) for one in self.bundles.values()))

    def _count(self):
        self.arrived += 1

    def send(self, name, ms, value=None, run=RUN):
        """Send the value at `ms`, which is `ms` unless another one is given, and wait until it is there."""
        codec = PortCodec(self.plan.participants[name].port("out"))
        step = -1 if ms == 0 else ms // 2 - self.plan.participants[name].period
        before = self.arrived + self.refusals.total
        bundle = self.bundles[name]
        bundle.add(0, codec.pack(np.array([float(ms if value is None else value)])))
        bundle.send(Tag.pack(run, 0, step, ms * MS))
        until(lambda: self.arrived + self.refusals.total > before)

    def take(self):
        """Return time (ms), both values and the number of missed states; None if there is nothing new."""
        state = self.inputs.pop_newest()
        if state is None:
            return None
        values = (float(state.values[port][0]) for port in "ab")
        return (state.time_ns // MS, *values, state.missed)

    def close(self):
        self.inputs.close()
        for bundle in self.bundles.values():
            bundle.close()


@pytest.fixture
def sources():
    with open_session("router", listen=[free_endpoint()]) as session:
        made = Sources(session)
        yield made
        made.close()


def test_the_first_state_is_whole_and_that_of_time_0(sources):
    sources.send("robot", 0, 5.0)
    sources.send("robot", 40)
    assert sources.take() is None
    sources.send("tissue", 0, 6.0)
    sources.send("tissue", 0, 8.0)  # repeated: it is the same, or ignored
    assert sources.take() == (0, 5.0, 6.0, 0)
    assert sources.take() == (40, 40.0, 6.0, 0)
    assert sources.take() is None


def test_what_arrives_meanwhile_is_missed_but_for_the_newest(sources):
    for name in ("robot", "tissue"):
        sources.send(name, 0)
    assert sources.take() == (0, 0.0, 0.0, 0)
    for ms in (40, 80):
        sources.send("robot", ms)
    assert sources.take() == (80, 80.0, 0.0, 1)


def test_inputs_are_of_one_moment_whichever_comes_first(sources):
    for name in ("robot", "tissue"):
        sources.send(name, 0)
    sources.take()
    for ms in (40, 80, 120):
        sources.send("robot", ms)
    assert sources.take() == (80, 80.0, 0.0, 1)  # at 120 ms the tissue of 100 ms is due
    sources.send("tissue", 100)
    assert sources.take() == (120, 120.0, 100.0, 0)


def test_states_before_one_begins_to_count_are_not_missed(sources):
    for name in ("robot", "tissue"):
        sources.send(name, 0)
    sources.take()
    sources.send("tissue", 5000)
    sources.send("robot", 5040)
    sources.inputs.miss_none()
    assert sources.take() == (5040, 5040.0, 5000.0, 0)


def test_messages_of_another_run_and_invalid_ones_are_refused(sources):
    for name in ("robot", "tissue"):
        sources.send(name, 0)
    sources.take()
    sources.send("robot", 40, run=RUN + 1)
    assert sources.take() is None
    bundle = sources.bundles["robot"]
    bundle.add(3, b"123")
    bundle.send(Tag.pack(RUN, 0, 19, 40 * MS))
    until(lambda: sources.refusals.total >= 2)
    assert sources.refusals.total == 2
